"""Scenes: layers of cloud over ground, in air, seen in bands."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from cloudjax.air.atmosphere import AbstractTemperature, StandardAtmosphere
from cloudjax.air.clear_air import Air
from cloudjax.clouds.source import AbstractCloudSource
from cloudjax.geometry.shells import Shell
from cloudjax.light.bands import EmissiveBands, ReflectiveBands
from cloudjax.light.emission import EmittingSlabs
from cloudjax.light.ground import AbstractGround, UniformGround
from cloudjax.light.reflection import AbstractReflection, Scatterers

from .shadows import Shadows


class Layer(eqx.Module):
    """A source of cloud and what its particles do to light.

    **Fields:**

    - `name`: of the cloud class.
    - `cloud`: where the cloud is.
    - `extinction_per_m`: β within the cloud in reflective bands.
    - `infrared_ratio`: absorption over β at the emissive reference band.
    - `co_albedo`: 1 - ω in each reflective band.
    - `relative_absorption`: of each emissive band, 1 at the reference band; that of the
      pure absorber that stands for the cloud (`Particles.effective_absorption_in`).
    - `steps`: of the march.
    - `asymmetry`: mean scattering cosine in each reflective band; for strategies that
      have a phase function.
    - `relative_extinction`: of each reflective band over β; None is one in all.
    - `thermal_co_albedo`, `thermal_asymmetry`: 1 - ω and mean scattering cosine in each
      emissive band; for scenes whose cloud scatters there.
    """

    cloud: AbstractCloudSource
    extinction_per_m: Float[Array, ""]
    infrared_ratio: Float[Array, ""]
    co_albedo: Float[Array, " reflective"]
    relative_absorption: Float[Array, " emissive"]
    name: str = eqx.field(static=True)
    steps: int = eqx.field(static=True, default=24)
    asymmetry: Float[Array, " reflective"] | None = None
    relative_extinction: Float[Array, " reflective"] | None = None
    thermal_co_albedo: Float[Array, " emissive"] | None = None
    thermal_asymmetry: Float[Array, " emissive"] | None = None

    @property
    def sunlit_per_m(self) -> Float[Array, " reflective"]:
        """Extinction in each reflective band."""
        if self.relative_extinction is None:
            return self.extinction_per_m * jnp.ones_like(self.co_albedo)
        return self.extinction_per_m * self.relative_extinction

    @property
    def scatterers(self) -> Scatterers:
        """Its particles in each reflective band."""
        none = jnp.zeros_like(self.co_albedo)
        return Scatterers(
            self.co_albedo, none if self.asymmetry is None else self.asymmetry
        )

    @property
    def returned_per_m(self) -> Float[Array, " reflective"]:
        """Of the light in each reflective band what is sent back: bβ (`shadows.py`)."""
        particles = self.scatterers
        turned = (1 - particles.co_albedo) * particles.asymmetry
        return self.sunlit_per_m * (1 - turned) / 2

    @property
    def absorptions_per_m(self) -> Float[Array, " emissive"]:
        """Of the pure absorber in each emissive band."""
        return self.extinction_per_m * (self.infrared_ratio * self.relative_absorption)

    @property
    def emitters(self) -> Scatterers:
        """Its particles in each emissive band, where thermal scattering is asked."""
        if self.thermal_co_albedo is None or self.thermal_asymmetry is None:
            raise ValueError(
                f"The layer {self.name} has no co-albedo or asymmetry in the thermal "
                "bands: give both, or leave the scene's emission None."
            )
        return Scatterers(self.thermal_co_albedo, self.thermal_asymmetry)


class BandRadiances(eqx.Module):
    """Radiances of a set of rays in the units of the bands; None where not asked.

    A band that sees the sun and emits too has a row in each: `Scene.total` adds them.
    """

    reflective: Float[Array, "reflective rays"] | None
    emissive: Float[Array, "emissive rays"] | None

    def __getitem__(self, index) -> "BandRadiances":
        """Select some of the rays."""
        return jax.tree.map(lambda x: x[:, index], self)


class Scene(eqx.Module):
    """All that is seen, but for where from: a pytree of arrays.

    **Fields:**

    - `layers`: in any order; their shells may overlap.
    - `reflective`, `emissive`: the bands that are asked; None leaves a part out of the
      computation altogether. A band may be in both, such as 3.9 µm by day.
    - `reflection`: the strategy for sunlight.
    - `temperature`: of the cloud and the air.
    - `emission`: how cloud scatters thermal radiation; None takes it for an absorber.
    - `air`: above the clouds; None leaves it out.
    - `shadows`: how clouds shade each other; None where they do not.
    - `ground`: what is below the clouds.
    """

    layers: tuple[Layer, ...]
    reflective: ReflectiveBands | None
    emissive: EmissiveBands | None
    reflection: AbstractReflection
    temperature: AbstractTemperature = eqx.field(default_factory=StandardAtmosphere)
    emission: EmittingSlabs | None = None
    air: Air | None = None
    shadows: Shadows | None = None
    ground: AbstractGround = eqx.field(default_factory=UniformGround)

    def __check_init__(self):
        if self.reflective is None and self.emissive is None:
            raise ValueError("A scene without bands shows nothing: ask at least one.")

    @property
    def shells(self) -> tuple[Shell, ...]:
        """The air that holds the cloud of each layer."""
        return tuple(layer.cloud.shell for layer in self.layers)

    @property
    def shell(self) -> Shell:
        """The air that holds all cloud."""
        shells = self.shells
        if not shells:
            return Shell(0.0, 10e3)
        return Shell(min(s.bottom_m for s in shells), max(s.top_m for s in shells))

    @property
    def bands(self) -> tuple[int, ...]:
        """Numbers, each once: bands that see the sun, then those that only emit."""
        groups = (self.reflective, self.emissive)
        numbers = (n for group in groups if group is not None for n in group.numbers)
        return tuple(dict.fromkeys(numbers))

    def total(self, seen: BandRadiances) -> Float[Array, "bands rays"]:
        """Reflected and emitted radiance together, one row for each of `bands`."""
        rows: dict[int, Array] = {}
        groups = (self.reflective, seen.reflective), (self.emissive, seen.emissive)
        for bands, parts in groups:
            if bands is not None and parts is not None:
                for number, part in zip(bands.numbers, parts, strict=True):
                    rows[number] = rows[number] + part if number in rows else part
        return jnp.stack([rows[number] for number in self.bands])
