"""Classes of cloud have conditions, a shape, a wind, particles and priors.

One definition serves scenes over weather and fits to imagery. The four classes of
Schinder et al. (2024), Table 1, are in `classes.toml`, what fits start from in
`imagery_classes.toml`; `class_files.py` reads both, and a user's own.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import jax.numpy as jnp

from cloudjax.geometry.shells import Shell
from cloudjax.light.optics import Particles
from cloudjax.weather.coarse_fields import Response
from cloudjax.weather.masks import Conditions, fraction_to_mask

from .class_parameters import (
    ALTITUDE_SPREAD_M,
    PERSISTENCE,
    PLACES,
    RADII,
    UNLESS_ASKED,
    USUAL,
    WEIGHT,
    ClassParameter,
    Prior,
    short_name,
)
from .cloud_function import CloudFunction
from .fractal import FractalCloud
from .ladder import Ladder
from .level_set import Latent


Phase = Literal["water", "ice"]
# Keeps the slope of the level set finite where noise loses nothing to a footprint.
_SMOOTHING = 0.02
# Of clouds whose barriers a fit may move.
_USUAL_THICKNESS_M = 1500.0


@dataclass(frozen=True)
class ClassTexture:
    """A `ClassTexture` is one texture of a class of cloud.

    **Fields:**

    - `ladder`: noise, from which wavelengths to which.
    - `weight`: standard deviation, all rungs together.
    - `persistence`: amplitude of an octave over that of the next longer one.
    - `displacement_hours`: how long the wind has drawn it out.
    - `name`: for the parameter that is its weight; empty is its place, from 1.
    - `gains`: a factor on the amplitude of each rung; empty is 1 for all.
    """

    ladder: Ladder
    weight: float
    persistence: float
    displacement_hours: float
    name: str = ""
    gains: tuple[float, ...] = ()

    def __post_init__(self):
        if not self.persistence > 0:
            raise ValueError("persistence of a texture must be positive.")
        if not self.displacement_hours >= 0:
            raise ValueError("displacement_hours of a texture must not be negative.")
        rungs = len(self.ladder.octaves)
        if self.gains and len(self.gains) != rungs:
            raise ValueError(
                f"gains of a texture are {len(self.gains)} for {rungs} rungs: give one "
                "for each, or none."
            )

    @property
    def gain_of_rungs(self) -> tuple[float, ...]:
        """Give the gain of each rung, the longest first."""
        return self.gains or (1.0,) * len(self.ladder.octaves)


@dataclass(frozen=True)
class ImageryRule:
    """An `ImageryRule` says which cloud pixels of imagery belong to a class.

    Temperatures are compared with those of the US Standard Atmosphere 1976. An image
    without a window band does not tell them: all its cloud is that of the classes that
    need not be colder than anything.

    **Fields:**

    - `colder_than_standard_at_m`: pixels are colder than the air at this altitude.
    - `warmer_than_standard_at_m`: pixels are no colder than the air at this altitude;
      colder ones hide what is below them.
    - `brighter_than`, `darker_than`: reflectance factor of pixels in the band that
      tells cloud by day. An image without such a band has no class that must be
      darker than anything: its clouds are taken for thick.
    - `altitude_m`: where the clouds stand, to undo the parallax; None for the middle of
      the shell.
    """

    colder_than_standard_at_m: float | None = None
    warmer_than_standard_at_m: float | None = None
    brighter_than: float | None = None
    darker_than: float | None = None
    altitude_m: float | None = None


@dataclass(frozen=True)
class CloudClass:
    """A `CloudClass` says what clouds of one kind are like, and where they stand.

    **Fields:**

    - `name`: of the class.
    - `conditions`: when it is present, where the weather is sampled, and its shell.
    - `threshold`, `mask_gain`: T and g of eq. (1).
    - `base_m`, `top_m`, `barrier_scale_m`: z_b, z_t and h of the barriers. With a
      threshold below zero there is cloud even where the base is above the top.
    - `textures`: the first has weight 1, which fixes the gauge of eq. (1).
    - `mask_displacement_hours`: how long the wind has drawn out the weather mask.
    - `extinction_per_m`: physical, of the cloud at 0.64 µm.
    - `particles`: "water" or "ice".
    - `effective_radius_um`: of the particles.
    - `infrared_ratio`: effective absorption at 10.35 µm over extinction; None for that
      of the particles, which follows their radius unless `priors` has one for it.
    - `extinction_growth`: of the logarithm of extinction, per unit of CF in the cloud.
    - `depth_response`, `top_response`, `roughness_response`: how strongly the clouds
      follow coarse fields, see `CoarseFields`.
    - `imagery`: which cloud pixels of imagery it takes; None leaves it out of fits.
    - `priors`: bounds and priors by key where they are not the usual ones.
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
    infrared_ratio: float | None = None
    extinction_growth: float = 0.0
    depth_response: float = 1.0
    top_response: float = 1.0
    roughness_response: float = 1.0
    imagery: ImageryRule | None = None
    priors: Mapping[str, Prior] = field(default_factory=dict)

    def __post_init__(self):
        positive = ["barrier_scale_m", "extinction_per_m", "effective_radius_um"]
        if self.infrared_ratio is not None:
            positive.append("infrared_ratio")
        for name in positive:
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive.")
        if not self.mask_displacement_hours >= 0:
            raise ValueError("mask_displacement_hours must not be negative.")
        if not self.textures or self.textures[0].weight != 1:
            raise ValueError("textures must begin with one of weight 1.")
        known = {*self._weights, *self._persistences, *PLACES}
        for key in self.priors:
            if key not in known:
                raise ValueError(
                    f"priors has an unknown key, {key!r}: the keys are "
                    f"{', '.join(sorted(known))}."
                )

    @property
    def shell(self) -> Shell:
        """Give the air that the class stands in."""
        c = self.conditions
        return Shell(float(c.shell_bottom_m), float(c.shell_top_m))

    @property
    def marched(self) -> Shell:
        """Give the part of the shell where the barriers leave cloud a chance.

        Steps are spent there only. Beyond, they exceed the greatest CF that there is:
        a mask of certain cloud with every texture at three standard deviations.
        """
        textures = sum(abs(t.weight) for t in self.textures)
        certain = float(fraction_to_mask(jnp.ones(())))
        greatest = self.mask_gain * certain + 3 * textures - self.threshold
        reach = self.barrier_scale_m * math.log(max(greatest, 1.0))
        bottom = max(self.shell.bottom_m, self.base_m - reach)
        top = min(self.shell.top_m, self.top_m + reach)
        return Shell(bottom, top) if bottom < top else self.shell

    @property
    def optics(self) -> Particles:
        """Give the particles."""
        return Particles(self.particles, self.effective_radius_um)

    @property
    def absorption_ratio(self) -> float:
        """Give effective absorption at 10.35 µm over extinction at 0.64 µm."""
        if self.infrared_ratio is not None:
            return self.infrared_ratio
        return float(self.optics.infrared_ratio)

    @property
    def own_infrared_ratio(self) -> float | None:
        """Give the absorption ratio if it is a number of its own; None if it follows
        from the particles.
        """
        return self.absorption_ratio if self._listed("infrared_ratio") else None

    @property
    def parameters(self) -> tuple[ClassParameter, ...]:
        """List all that a fit may move, in physical terms, with bounds and priors."""
        found = [
            ClassParameter(
                key,
                key,
                f"cloud.function.weights.{i}",
                self.textures[i].weight,
                self.priors.get(key, USUAL["weight"]),
            )
            for key, i in self._weights.items()
        ]
        found += [
            ClassParameter(
                key,
                key,
                f"cloud.function.persistences.{i}",
                self.textures[i].persistence,
                self.priors[key],
            )
            for key, i in self._persistences.items()
            if key in self.priors
        ]
        for key, (path, unit) in PLACES.items():
            if not self._listed(key):
                continue
            value = (
                self.absorption_ratio if key == "infrared_ratio" else getattr(self, key)
            )
            prior = self.priors.get(key) or self._usual(key, value)
            found.append(ClassParameter(short_name(key), key, path, value, prior, unit))
        return tuple(found)

    def _listed(self, key: str) -> bool:
        """Tell whether a parameter has a place: what must be asked for, if it was."""
        asked = key in self.priors
        if key == "infrared_ratio":
            asked = asked or self.infrared_ratio is not None
        return asked or key not in UNLESS_ASKED

    def _usual(self, key: str, value: float) -> Prior:
        """The prior where neither the class nor a file gives one."""
        if key == "effective_radius_um":
            usual = RADII[self.particles]
            if usual.lower < value < usual.upper:
                return usual
            # A radius of the class's own choice is never out of its bounds.
            return replace(usual, lower=value / 2, upper=value * 2)
        return USUAL.get(key) or self._within_shell(value)

    def with_values(self, values: Mapping[str, float]) -> "CloudClass":
        """Change parameters, given by their short names, such as "top", in metres.

        **Raises:** `ValueError` for a name that the class has not.
        """
        keys = {short_name(key): key for key in PLACES}
        keys |= {key: key for key in (*self._weights, *self._persistences)}
        unknown = sorted(set(values) - set(keys))
        if unknown:
            raise ValueError(f"The class {self.name} has no {unknown[0]!r}.")
        textures = list(self.textures)
        changes = {}
        for name, value in values.items():
            if name in self._weights:
                i = self._weights[name]
                textures[i] = replace(textures[i], weight=float(value))
            elif name in self._persistences:
                i = self._persistences[name]
                textures[i] = replace(textures[i], persistence=float(value))
            else:
                changes[keys[name]] = float(value)
        return replace(self, textures=tuple(textures), **changes)

    def with_top(self, altitude_m: float) -> "CloudClass":
        """Move both barriers, so that the top is at an altitude of the shell or, if
        priors bound it, within these.
        """
        prior = self.priors.get("top_m") or self._within_shell(self.top_m)
        # A start on a bound would stay there.
        margin = 0.05 * (prior.upper - prior.lower)
        low = max(self.shell.bottom_m, prior.lower + margin)
        high = min(self.shell.top_m, prior.upper - margin)
        top_m = float(min(max(altitude_m, low), high))
        return replace(self, top_m=top_m, base_m=self.base_m + top_m - self.top_m)

    def with_room(self, altitude_m: float) -> "CloudClass":
        """Raise the shell's top to an altitude, if it is lower."""
        top_m = max(self.shell.top_m, altitude_m)
        return replace(self, conditions=replace(self.conditions, shell_top_m=top_m))

    def _within_shell(self, altitude_m: float) -> Prior:
        """Allow a barrier as far as its scale beyond the shell."""
        return Prior(
            min(self.shell.bottom_m, altitude_m) - self.barrier_scale_m,
            max(self.shell.top_m, altitude_m) + self.barrier_scale_m,
            ALTITUDE_SPREAD_M,
        )

    @property
    def _weights(self) -> dict[str, int]:
        """Places of the textures by the name of their weight; the first is held."""
        return {
            f"{WEIGHT}{texture.name or i + 1}": i
            for i, texture in enumerate(self.textures)
            if i > 0
        }

    @property
    def _persistences(self) -> dict[str, int]:
        """Places of the textures by the name of their persistence."""
        return {
            f"{PERSISTENCE}{texture.name or i + 1}": i
            for i, texture in enumerate(self.textures)
        }

    def cloud(self, seed: int, *, movable: bool = False) -> FractalCloud:
        """Make the source of cloud; same seed, same cloud.

        **Arguments:** `movable`: the whole shell is sampled, for a fit will move the
        barriers; else that part of it in which there can be cloud.
        """
        return FractalCloud(
            function=CloudFunction(
                weights=jnp.asarray([t.weight for t in self.textures], float),
                persistences=jnp.asarray([t.persistence for t in self.textures], float),
                gains=jnp.asarray(
                    [gain for t in self.textures for gain in t.gain_of_rungs], float
                ),
                mask_gain=jnp.asarray(self.mask_gain, float),
                threshold=jnp.asarray(self.threshold, float),
                barrier_strength=jnp.asarray(1.0),
                base_m=jnp.asarray(self.base_m, float),
                top_m=jnp.asarray(self.top_m, float),
                barrier_scale_m=jnp.asarray(self.barrier_scale_m, float),
                smoothing=jnp.asarray(_SMOOTHING),
            ),
            latent=Latent.equal_shares(),
            shell=self.shell if movable else self.marched,
            ladders=tuple(t.ladder for t in self.textures),
            seed=seed,
            thickness_m=_USUAL_THICKNESS_M
            if movable
            else max(self.top_m - self.base_m, self.barrier_scale_m),
            movable=movable,
            extinction_growth=jnp.asarray(self.extinction_growth, float),
            response=Response(
                depth=jnp.asarray(self.depth_response, float),
                top=jnp.asarray(self.top_response, float),
                roughness=jnp.asarray(self.roughness_response, float),
            ),
        )
