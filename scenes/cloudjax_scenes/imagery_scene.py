"""A scene made from imagery: only what the imagery shows is built.

There is no cirrus without a window band, and no air and no sunlight in bands that are
not asked.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cloudjax import (
    Air,
    Band,
    CloudClass,
    CoarseFields,
    DisplacementMap,
    EmissiveBands,
    MaskGrid,
    ReflectiveBands,
    Scene,
    StandardAtmosphere,
    class_layer,
)
from cloudjax.air.clear_air import rayleigh
from cloudjax_data import DataError

from .imagery import Imagery
from .imagery_evidence import ClassEvidence
from .imagery_sky import ImagerySky
from .lights import PAPER, Light
from .weather_analysis import Analysis


# Deviations of the prior of tops, that shells have room for above the highest.
ROOM_SPREADS = 3.0


@dataclass(frozen=True, eq=False)
class SceneFromImagery:
    """What a scene is built of where imagery tells where clouds are.

    **Fields:**

    - `imagery`: where clouds stand, and what is seen without them.
    - `analysis`: the weather of that hour: winds that draw the textures, temperatures
      and humidities; None for still air and the standard atmosphere.
    - `light`: the strategy for light.
    - `known`: classes of cloud by name; None for those of the light.
    - `seed`: of all textures; `steps`: of the march through each shell.
    - `placed`: whether clouds start as high as the imagery has them; no longer where
      a fit has found how high they are.
    """

    imagery: Imagery
    analysis: Analysis | None = None
    light: Light = PAPER
    known: Mapping[str, CloudClass] | None = None
    seed: int = 0
    steps: int = 24
    placed: bool = True

    def __post_init__(self):
        missing = [
            name for name in self.imagery.fractions if name not in self.available
        ]
        if missing:
            raise DataError(
                f"{self.imagery.name} has clouds of the class {missing[0]}, which is "
                f"not among {', '.join(self.available)}: add it to the file of classes."
            )

    @property
    def classes(self) -> tuple[CloudClass, ...]:
        """Give the classes that the imagery shows, one for each layer, and as high as
        there.
        """
        evidence = self.imagery.evidence if self.placed else {}
        found = [self.available[name] for name in self.imagery.fractions]
        return tuple(
            _raised(one, evidence[one.name]) if one.name in evidence else one
            for one in found
        )

    @property
    def available(self) -> Mapping[str, CloudClass]:
        """Give all classes that the scene may have, by name."""
        return self.light.imagery_classes() if self.known is None else self.known

    @property
    def notes(self) -> list[str]:
        """Say what the weather leaves open, in sentences."""
        return [] if self.analysis is None else self.analysis.notes(self.imagery)

    def build(self) -> Scene:
        """Build the scene, at the values of the classes.

        The clouds stand where the imagery has them, drawn by the winds of the analysis;
        the ground is the clear sky of the imagery.
        """
        imagery, light = self.imagery, self.light
        temperature, humidity = (
            (StandardAtmosphere(), None)
            if self.analysis is None
            else self.analysis.air(imagery)
        )
        sunlit, emissive = imagery.sunlit, imagery.emissive
        layers = tuple(
            class_layer(
                one,
                sunlit=[band.number for band in sunlit],
                thermal=[band.number for band in emissive],
                seed=self.seed + 100 * i,
                steps=self.steps,
                extinction_share=light.share,
                movable=True,
                mask=mask,
                displacements=maps,
                fields=self.fields.get(one.name),
            )
            for i, (one, mask, maps) in enumerate(
                zip(self.classes, self._masks(), self._displacements(), strict=True)
            )
        )
        return Scene(
            layers=layers,
            reflective=ReflectiveBands.of(
                sunlit,
                imagery.earth_sun_distance_au,
                [path_reflectance(band, light) for band in sunlit],
            ),
            emissive=EmissiveBands.of(emissive),
            reflection=light.reflection(),
            emission=light.emission_in(emissive),
            temperature=temperature,
            air=Air.of_bands(tuple(imagery.bands), humidity) if light.air else None,
            ground=ImagerySky.of(imagery),
        )

    @property
    def fields(self) -> dict[str, CoarseFields]:
        """Tell what clouds are like from place to place, by class."""
        return {name: told.fields for name, told in self.imagery.evidence.items()}

    def _masks(self) -> list[MaskGrid]:
        imagery = self.imagery
        axes = imagery.latitude_deg, imagery.longitude_deg
        return [
            MaskGrid.from_fraction(fraction, *axes)
            for fraction in imagery.fractions.values()
        ]

    def _displacements(self) -> Sequence[Sequence[DisplacementMap | None] | None]:
        if self.analysis is None:
            return [None] * len(self.classes)
        return self.analysis.displacements(self.classes)


def _raised(one: CloudClass, told: ClassEvidence) -> CloudClass:
    """The class where the imagery has it, with room for the highest of its clouds.

    A fit may raise all of them by some deviations of the prior.
    """
    one = one.with_top(told.top_m)
    top = next(p for p in one.parameters if p.key == "top_m")
    highest_m = float(told.nodes[..., 1].max())
    return one.with_room(one.top_m + highest_m + ROOM_SPREADS * top.prior.spread)


def path_reflectance(band: Band, light: Light) -> float:
    """Return the reflectance factor of the air where a path stands for it, else 0.

    Rayleigh scattering to first order, of the air above 850 hPa: phase function
    3/4 (1 + cos²Θ) near backscatter, over the cosines of two 50 degree slants.
    """
    if light.air:
        return 0.0
    τ = float(rayleigh.optical_depth(band.wavelength_um))
    return float(0.85 * τ * 1.5 / (4 * np.cos(np.radians(50))))
