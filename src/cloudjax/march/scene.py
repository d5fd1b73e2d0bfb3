"""Scenes are layers of cloud over ground, in air, seen in bands."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from cloudjax.air.atmosphere import AbstractTemperature, StandardAtmosphere
from cloudjax.air.clear_air import Air
from cloudjax.clouds.source import AbstractCloudSource
from cloudjax.geometry.shells import Shell
from cloudjax.light.bands import EmissiveBands, ReflectiveBands
from cloudjax.light.cloud_optics import AbstractCloudOptics
from cloudjax.light.emission import EmittingSlabs
from cloudjax.light.ground import AbstractGround, UniformGround
from cloudjax.light.reflection import AbstractReflection

from .shadows import Shadows


class Layer(eqx.Module):
    """A `Layer` is a source of cloud, and what its particles do to light.

    **Fields:**

    - `name`: of the cloud class.
    - `cloud`: where the cloud is.
    - `extinction_per_m`: β within the cloud, as the scene's light knows it.
    - `optics`: what its particles do to light in the bands of the scene.
    - `steps`: of the march.
    """

    cloud: AbstractCloudSource
    extinction_per_m: Float[Array, ""]
    optics: AbstractCloudOptics
    name: str = eqx.field(static=True)
    steps: int = eqx.field(static=True, default=24)

    @property
    def sunlit_per_m(self) -> Float[Array, " reflective"]:
        """Give the extinction in each reflective band."""
        return self.extinction_per_m * self.optics.extinction

    @property
    def returned_per_m(self) -> Float[Array, " reflective"]:
        """Give what is sent back of light in reflective bands: bβ (`shadows.py`)."""
        particles = self.optics.scatterers
        turned = (1 - particles.co_albedo) * particles.asymmetry
        return self.sunlit_per_m * (1 - turned) / 2

    @property
    def absorptions_per_m(self) -> Float[Array, " emissive"]:
        """Give the extinction of the pure absorber in each emissive band."""
        return self.extinction_per_m * self.optics.absorption


class BandRadiances(eqx.Module):
    """`BandRadiances` are those of a set of rays in the units of the bands; None where
    not asked.

    A band that sees the sun and emits too has a row in each: `Scene.total` adds them.
    """

    reflective: Float[Array, "reflective rays"] | None
    emissive: Float[Array, "emissive rays"] | None

    def __getitem__(self, index) -> "BandRadiances":
        """Select some of the rays."""
        return jax.tree.map(lambda x: x[:, index], self)


class Scene(eqx.Module):
    """A `Scene` is all that is seen, but for where from: a pytree of arrays.

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
        """Give the air that holds the cloud of each layer."""
        return tuple(layer.cloud.shell for layer in self.layers)

    @property
    def shell(self) -> Shell:
        """Give the air that holds all cloud."""
        shells = self.shells
        if not shells:
            return Shell(0.0, 10e3)
        return Shell(min(s.bottom_m for s in shells), max(s.top_m for s in shells))

    @property
    def bands(self) -> tuple[int, ...]:
        """Give the numbers of the bands, each once: those that see the sun, then those
        that only emit.
        """
        groups = (self.reflective, self.emissive)
        numbers = (n for group in groups if group is not None for n in group.numbers)
        return tuple(dict.fromkeys(numbers))

    def drawn_anew(self, number: int) -> "Scene":
        """Return the scene with another draw of its clouds: other textures of the same
        parameters, at the same places; number 0 is the scene itself.
        """
        layers = tuple(
            replace(layer, cloud=layer.cloud.drawn_anew(number))
            for layer in self.layers
        )
        return replace(self, layers=layers)

    def total(self, seen: BandRadiances) -> Float[Array, "bands rays"]:
        """Return reflected and emitted radiance together, a row for each of `bands`."""
        rows: dict[int, Array] = {}
        groups = (self.reflective, seen.reflective), (self.emissive, seen.emissive)
        for bands, parts in groups:
            if bands is not None and parts is not None:
                for number, part in zip(bands.numbers, parts, strict=True):
                    rows[number] = rows[number] + part if number in rows else part
        return jnp.stack([rows[number] for number in self.bands])
