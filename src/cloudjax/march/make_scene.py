"""Scenes are made from the names of classes and bands, for work by hand."""

from collections.abc import Sequence

from cloudjax.air.clear_air import Air
from cloudjax.clouds.class_files import cloud_classes
from cloudjax.clouds.classes import CloudClass
from cloudjax.light.bands import (
    Band,
    EmissiveBands,
    ReflectiveBands,
    bands_named,
    sunlit_and_thermal,
)
from cloudjax.light.emission import EmittingSlabs
from cloudjax.light.ground import AbstractGround, UniformGround
from cloudjax.light.reflectance import PlaneParallel
from cloudjax.light.reflection import Slabs
from cloudjax.weather.masks import AbstractMask, UniformMask

from .layer import class_layer
from .scene import Layer, Scene
from .shadows import Shadows


def make_scene(
    bands: Sequence[int | str],
    classes: Sequence[CloudClass | str] = ("low_cumulus",),
    *,
    cover: float | AbstractMask = 0.5,
    ground: AbstractGround | None = None,
    air: bool = True,
    shadows: Shadows | None = None,
    night: bool = False,
    seed: int = 0,
    steps: int = 24,
    earth_sun_distance_au: float = 1.0,
) -> Scene:
    """Make a scene of classes of cloud, seen in nominal ABI bands by physical light.

    Only what the bands need is built. For other light, air or temperatures, build a
    `Scene` of `class_layer`s.

    **Arguments:**

    - `bands`: numbers or names, such as 2 or "C02".
    - `classes`: of cloud, or names of those of Table 1 (`cloud_classes`).
    - `cover`: cloud fraction of each class, 0 to 1; or a mask of the weather.
    - `ground`: by default a dark, even one of 288 K.
    - `air`: whether gases and Rayleigh scattering count.
    - `shadows`: how clouds shade each other; None where they do not.
    - `night`: leave the sun out of bands that also emit.
    - `seed`: of all textures; same seed, same clouds.
    - `steps`: of the march through each shell.

    **Raises:** `ValueError` for a band or a class that does not exist.
    """
    chosen = bands_named(*bands)
    sunlit, thermal = sunlit_and_thermal(chosen, day=not night)
    if not isinstance(cover, AbstractMask):
        cover = UniformMask.from_fraction(cover)
    networks = PlaneParallel.load()
    numbers = {"sunlit": _numbers(sunlit), "thermal": _numbers(thermal)}
    return Scene(
        layers=_layers(classes, seed, **numbers, steps=steps, mask=cover),
        reflective=ReflectiveBands.of(sunlit, earth_sun_distance_au),
        emissive=EmissiveBands.of(thermal),
        reflection=Slabs(networks),
        emission=EmittingSlabs(networks) if thermal else None,
        air=Air.of_bands(_numbers(chosen)) if air else None,
        shadows=shadows,
        ground=UniformGround() if ground is None else ground,
    )


def _layers(
    classes: Sequence[CloudClass | str], seed: int, **of_each
) -> tuple[Layer, ...]:
    return tuple(
        class_layer(_class(one), seed=seed + 100 * i, **of_each)
        for i, one in enumerate(classes)
    )


def _numbers(bands: Sequence[Band]) -> list[int]:
    return [band.number for band in bands]


def _class(one: CloudClass | str) -> CloudClass:
    if isinstance(one, CloudClass):
        return one
    known = cloud_classes()
    if one not in known:
        raise ValueError(
            f"There is no class of cloud {one!r}: the classes are {', '.join(known)}."
        )
    return known[one]
