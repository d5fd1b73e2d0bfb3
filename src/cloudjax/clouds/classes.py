"""Classes of cloud as data: when each is there, its shape, its wind and its particles.

The four of Schinder et al. (2024), Table 1, are in `classes.toml`; a fifth is
written in the same way and read with `load_classes`.
"""

import importlib.resources
import math
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, cast, get_args

import jax.numpy as jnp

from cloudjax.geometry.shells import Shell
from cloudjax.weather.masks import Conditions, fraction_to_mask

from .fractal import CloudFunction, FractalCloud, Latent
from .texture import Fractal, InvertedWorley, Perlin


Phase = Literal["water", "ice"]
# Keeps the slope of the level set finite where a texture loses nothing to a footprint.
_SMOOTHING = 0.02
_FRACTALS: dict[str, type[Fractal]] = {
    "perlin": Perlin,
    "inverted_worley": InvertedWorley,
}


@dataclass(frozen=True)
class ClassTexture:
    """One texture of a class of cloud.

    **Fields:**

    - `fractal`: what it is.
    - `length_scale_m`: its period LS_i.
    - `weight`: m_i.
    - `displacement_hours`: how long the wind has drawn it out.
    """

    fractal: Fractal
    length_scale_m: float
    weight: float
    displacement_hours: float

    def __post_init__(self):
        if not self.length_scale_m > 0:
            raise ValueError("length_scale_m of a texture must be positive.")
        if not self.displacement_hours >= 0:
            raise ValueError("displacement_hours of a texture must not be negative.")


@dataclass(frozen=True)
class CloudClass:
    """A class of cloud.

    **Fields:**

    - `name`: of the class.
    - `conditions`: when it is present, where the weather is sampled, and its shell.
    - `threshold`, `mask_gain`: T and g of eq. (1).
    - `base_m`, `top_m`, `barrier_scale_m`: z_b, z_t and h of the barriers.
    - `textures`: the first has weight 1, which fixes the gauge of eq. (1).
    - `mask_displacement_hours`: how long the wind has drawn out the weather mask.
    - `extinction_per_m`: of the cloud at visible wavelengths.
    - `particles`: "water" or "ice".
    - `effective_radius_um`: of the particles.
    """

    name: str
    conditions: Conditions
    threshold: float
    mask_gain: float
    base_m: float
    top_m: float
    barrier_scale_m: float
    textures: tuple[ClassTexture, ...]
    mask_displacement_hours: float
    extinction_per_m: float
    particles: Phase
    effective_radius_um: float

    def __post_init__(self):
        if not self.base_m < self.top_m:
            raise ValueError("base_m must be less than top_m.")
        for name in ("barrier_scale_m", "extinction_per_m", "effective_radius_um"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive.")
        if not self.mask_displacement_hours >= 0:
            raise ValueError("mask_displacement_hours must not be negative.")
        if not self.textures or self.textures[0].weight != 1:
            raise ValueError("textures must begin with one of weight 1.")

    @property
    def shell(self) -> Shell:
        """The air that the class is looked for in."""
        c = self.conditions
        return Shell(float(c.shell_bottom_m), float(c.shell_top_m))

    @property
    def marched(self) -> Shell:
        """The part of the shell where the barriers leave cloud a chance.

        Steps are spent there only. Beyond, they exceed the greatest CF that there is:
        a mask of certain cloud with every texture at three standard deviations.
        """
        textures = sum(abs(t.weight) for t in self.textures)
        certain = float(fraction_to_mask(jnp.ones(())))
        greatest = self.mask_gain * certain + 3 * textures - self.threshold
        reach = self.barrier_scale_m * math.log(max(greatest, 1.0))
        bottom = max(self.shell.bottom_m, self.base_m - reach)
        return Shell(bottom, min(self.shell.top_m, self.top_m + reach))

    def cloud(self, seed: int) -> FractalCloud:
        """The class as a source of cloud; same seed, same cloud."""
        return FractalCloud(
            function=CloudFunction(
                weights=jnp.asarray([t.weight for t in self.textures], float),
                mask_gain=jnp.asarray(self.mask_gain, float),
                threshold=jnp.asarray(self.threshold, float),
                barrier_strength=jnp.asarray(1.0),
                base_m=jnp.asarray(self.base_m, float),
                top_m=jnp.asarray(self.top_m, float),
                barrier_scale_m=jnp.asarray(self.barrier_scale_m, float),
                smoothing=jnp.asarray(_SMOOTHING),
            ),
            latent=Latent.gauss_hermite(),
            shell=self.marched,
            fractals=tuple(t.fractal for t in self.textures),
            length_scales_m=tuple(t.length_scale_m for t in self.textures),
            seed=seed,
            thickness_m=self.top_m - self.base_m,
        )


def cloud_classes() -> dict[str, CloudClass]:
    """The four classes of Schinder et al. (2024), Table 1, by name."""
    file = importlib.resources.files("cloudjax.clouds").joinpath("classes.toml")
    return _parse(file.read_text(encoding="utf-8"), "classes.toml")


def load_classes(path: str | Path) -> dict[str, CloudClass]:
    """Classes of cloud from a TOML file laid out as `classes.toml`.

    **Raises:** `ValueError` that names the file, the class and the key where a key is
    unknown, missing, of the wrong type or out of range; `OSError` where there is no
    file.
    """
    return _parse(Path(path).read_text(encoding="utf-8"), str(path))


def _parse(text: str, source: str) -> dict[str, CloudClass]:
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{source} is not valid TOML: {error}.") from error
    return {
        name: _class(name, table, f"{source}: class {name}")
        for name, table in tables.items()
    }


def _class(name: str, table: Any, where: str) -> CloudClass:
    known = [f.name for f in fields(CloudClass) if f.name != "name"]
    _require_keys(table, known, where)
    numbers = [f.name for f in fields(CloudClass) if f.type is float]
    textures, particles = table["textures"], table["particles"]
    if not isinstance(textures, list):
        raise ValueError(f"{where}: textures must be tables, [[{name}.textures]].")
    if particles not in get_args(Phase):
        raise ValueError(f'{where}: particles must be "water" or "ice".')
    try:
        return CloudClass(
            name=name,
            conditions=_conditions(table["conditions"], f"{where}, conditions"),
            textures=tuple(
                _texture(one, f"{where}, texture {i}")
                for i, one in enumerate(textures, start=1)
            ),
            particles=particles,
            **{key: _number(table, key, where) for key in numbers},
        )
    except _Located:
        raise
    except ValueError as error:
        raise _Located(f"{where}: {error}") from error


class _Located(ValueError):
    """An error whose message already says where it is."""


def _conditions(table: Any, where: str) -> Conditions:
    known = list(Conditions.__dataclass_fields__)
    _require_keys(table, known, where)
    values = {key: _number(table, key, where) for key in known}
    try:
        return Conditions(**values)
    except ValueError as error:
        raise _Located(f"{where}: {error}") from error


def _texture(table: Any, where: str) -> ClassTexture:
    if not isinstance(table, Mapping) or table.get("fractal") not in _FRACTALS:
        kinds = " or ".join(f'"{kind}"' for kind in _FRACTALS)
        raise _Located(f"{where}: must be a table with fractal = {kinds}.")
    fractal = _FRACTALS[table["fractal"]]
    shape = {f.name: f.type for f in fields(fractal)}
    numbers = [f.name for f in fields(ClassTexture) if f.name != "fractal"]
    _require_keys(table, ["fractal", *shape, *numbers], where)
    values = {
        key: _whole(table, key, where) if kind is int else _number(table, key, where)
        for key, kind in shape.items()
    }
    try:
        return ClassTexture(
            cast(Fractal, fractal(**cast(Any, values))),
            **{key: _number(table, key, where) for key in numbers},
        )
    except ValueError as error:
        raise _Located(f"{where}: {error}") from error


def _require_keys(table: Any, known: Collection[str], where: str) -> None:
    if not isinstance(table, Mapping):
        raise _Located(f"{where} must be a table, with {', '.join(known)}.")
    for problem, keys in (
        ("has unknown", [key for key in table if key not in known]),
        ("lacks the", [key for key in known if key not in table]),
    ):
        if keys:
            raise _Located(
                f"{where} {problem} key(s) {', '.join(keys)}; the keys are "
                f"{', '.join(known)}."
            )


def _number(table: Mapping[str, Any], key: str, where: str) -> float:
    value = table[key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _Located(f"{where}: {key} must be a number, not {value!r}.")
    return float(value)


def _whole(table: Mapping[str, Any], key: str, where: str) -> int:
    value = table[key]
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise _Located(f"{where}: {key} must be a whole number above 0, not {value!r}.")
    return value
