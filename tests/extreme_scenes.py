"""Scenes with all parts of the model, anywhere in the domain of its parameters.

A vector of numbers from 0 to 1 is a scene: each number is a place between the ends of
one parameter's range. `seen_from` gives what single rays see of a scene each, how much
light their clouds let through, and derivatives of both modes.
"""

import functools as ft
from dataclasses import dataclass, replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from cloudjax import (
    Air,
    CloudFunction,
    EmissiveBands,
    EmittingSlabs,
    FractalCloud,
    Gaussian,
    GivenOptics,
    InvertedWorley,
    Ladder,
    Latent,
    Layer,
    Particles,
    PlaneParallel,
    ReflectiveBands,
    Response,
    Scene,
    Shadows,
    Shell,
    Slabs,
    StandardAtmosphere,
    UniformGround,
    View,
    bands_named,
)
from cloudjax.clouds.class_parameters import USUAL
from cloudjax.march.marched_way import march_layers
from cloudjax.march.radiances import see


class Range(NamedTuple):
    """The ends of a parameter, and whether the way between them is logarithmic."""

    low: float
    high: float
    log: bool = False

    def at(self, part):
        if self.log:
            return jnp.exp(np.log(self.low) + part * np.log(self.high / self.low))
        return self.low + part * (self.high - self.low)

    def part(self, value: float) -> float:
        """Where a value is: the inverse of `at`."""
        if self.log:
            return float(np.log(value / self.low) / np.log(self.high / self.low))
        return (value - self.low) / (self.high - self.low)


def _usual(key: str) -> Range:
    """What a fit may move, as far as it may."""
    prior = USUAL[key]
    return Range(prior.lower, prior.upper, prior.log)


# Radii reach beyond both ends of the tables; `absorption` is a factor on 1 - ω.
OF_A_CLOUD = {
    "weight_2": _usual("weight"),
    "persistence": Range(0.05, 1.5),
    "mask_gain": _usual("mask_gain"),
    "threshold": _usual("threshold"),
    "base_m": Range(-1e3, 13e3),
    "top_m": Range(-1e3, 13e3),
    "barrier_scale_m": _usual("barrier_scale_m"),
    "smoothing": Range(0.0, 1.0),
    "extinction_per_m": _usual("extinction_per_m"),
    "infrared_ratio": _usual("infrared_ratio"),
    "extinction_growth": _usual("extinction_growth"),
    "depth_response": _usual("depth_response"),
    "top_response": _usual("top_response"),
    "roughness_response": _usual("roughness_response"),
    "radius_um": Range(0.5, 300.0, log=True),
    "absorption": Range(0.0, 1.0),
}
AROUND = {
    "offset_k": Range(-60.0, 40.0),
    "humidity": Range(0.0, 4.0),
    "albedo": Range(0.0, 1.0),
    "ground_k": Range(180.0, 340.0),
    "emissivity": Range(0.5, 1.0),
}


@dataclass(frozen=True)
class Kind:
    """What is static of a scene: the same for all that are compiled together.

    **Fields:** `shells`: one for each layer. `sunlit`, `thermal`: bands. `scatters`:
    whether cloud scatters thermal radiation. `backwards`: whether the scene has its
    layers in the opposite order. `waves_m`: of the first ladder, which has two rungs.
    """

    shells: tuple[Shell, ...] = (Shell(0.0, 12e3),)
    nodes: int = 3
    steps: int = 6
    sunlit: tuple[int, ...] = (2,)
    thermal: tuple[int, ...] = (13,)
    air: bool = False
    scatters: bool = True
    shadows: Shadows | None = None
    backwards: bool = False
    waves_m: tuple[float, float] = (20e3, 10e3)

    @property
    def ranges(self) -> dict[str, Range]:
        """Of all parameters, by name; those of the second layer end in "_b"."""
        own = {
            f"{name}{suffix}": r
            for suffix in ("", "_b")[: len(self.shells)]
            for name, r in OF_A_CLOUD.items()
        }
        return own | AROUND

    def vector(self, base: float = 0.5, **values: float) -> np.ndarray:
        """Make the vector of some values, in their own units; others are midway."""
        ranges = self.ranges
        assert set(values) <= set(ranges), set(values) - set(ranges)
        return np.array(
            [r.part(values[n]) if n in values else base for n, r in ranges.items()]
        )

    def scene(self, vector, networks: PlaneParallel) -> Scene:
        """Make the scene of a vector."""
        p = {
            name: r.at(part)
            for (name, r), part in zip(
                self.ranges.items(), jnp.asarray(vector, float), strict=True
            )
        }
        layers = [
            self._layer(i, {n: p[f"{n}{suffix}"] for n in OF_A_CLOUD})
            for i, suffix in enumerate(("", "_b")[: len(self.shells)])
        ]
        return Scene(
            layers=tuple(layers[::-1] if self.backwards else layers),
            reflective=ReflectiveBands.of(bands_named(*self.sunlit)),
            emissive=EmissiveBands.of(bands_named(*self.thermal)),
            reflection=Slabs(networks),
            temperature=StandardAtmosphere(p["offset_k"]),
            emission=EmittingSlabs(networks) if self.scatters else None,
            air=self._air(p["humidity"]) if self.air else None,
            shadows=self.shadows,
            ground=UniformGround(p["albedo"], p["ground_k"], p["emissivity"]),
        )

    def _air(self, humidity) -> Air:
        air = Air.of_bands((*self.sunlit, *self.thermal))
        return replace(air, specific_humidity=humidity * air.specific_humidity)

    def _layer(self, i: int, p: dict) -> Layer:
        particles = Particles(("water", "ice")[i], p["radius_um"])
        return Layer(
            cloud=self._cloud(i, p),
            extinction_per_m=p["extinction_per_m"],
            optics=GivenOptics(
                infrared_ratio=p["infrared_ratio"],
                co_albedo=p["absorption"] * particles.co_albedo_in(self.sunlit),
                asymmetry=particles.asymmetry_in(self.sunlit),
                relative_extinction=particles.relative_extinction_in(self.sunlit),
                relative_absorption=particles.relative_absorption_in(self.thermal),
                thermal_co_albedo=particles.thermal_co_albedo_in(self.thermal),
                thermal_asymmetry=particles.thermal_asymmetry_in(self.thermal),
            ),
            name=f"layer {i}",
            steps=self.steps,
        )

    def _cloud(self, i: int, p: dict) -> FractalCloud:
        one, slope = jnp.ones_like(p["threshold"]), p["persistence"]
        return FractalCloud(
            function=CloudFunction(
                weights=jnp.stack([one, p["weight_2"]]),
                persistences=jnp.stack([slope, slope]),
                gains=jnp.ones(3),
                barrier_strength=one,
                **{n: p[n] for n in ("mask_gain", "threshold", "base_m", "top_m")},
                **{n: p[n] for n in ("barrier_scale_m", "smoothing")},
            ),
            latent=Latent.equal_shares(self.nodes),
            shell=self.shells[i],
            ladders=(
                Ladder(Gaussian(), *self.waves_m),
                Ladder(InvertedWorley(), 6e3, 6e3),
            ),
            seed=3 + i,
            response=Response(
                *(p[f"{n}_response"] for n in ("depth", "top", "roughness"))
            ),
            extinction_growth=p["extinction_growth"],
        )


EVERYTHING = Kind(
    shells=(Shell(0.0, 6e3), Shell(4e3, 14e3)),
    sunlit=(2, 7),
    thermal=(7, 13),
    air=True,
    shadows=Shadows(2, points=2),
)


class Seen(NamedTuple):
    """Of each ray, what it sees of its own scene.

    **Fields:**

    - `radiance`: sunlight in each sunlit band, then emission in each thermal one.
    - `forward`: derivatives of the same along the tangent.
    - `reverse`: derivatives of their sum by each number of the vector.
    - `through`: transmittance of each layer's cloud at the reference band, up to the
      end of each step.
    - `cover`, `depth`: of the cloud.
    """

    radiance: np.ndarray
    forward: np.ndarray
    reverse: np.ndarray
    through: np.ndarray
    cover: np.ndarray
    depth: np.ndarray


def seen_from(kind: Kind, vectors, view: View, tangents=None) -> Seen:
    """What ray i sees of scene i: vectors and tangents are [rays parameters]."""
    vectors = jnp.asarray(vectors, float)
    tangents = jnp.asarray(np.ones(vectors.shape) if tangents is None else tangents)
    networks = PlaneParallel.load()
    (radiance, told), forward = _forward(
        kind, vectors, tangents.astype(float), view, networks
    )
    reverse = _reverse(kind, vectors, view, networks)
    return Seen(*map(np.asarray, (radiance, forward, reverse, *told)))


def radiance_from(kind: Kind, vectors, view: View) -> np.ndarray:
    """The radiances of `seen_from`, which are compiled faster alone."""
    vectors = jnp.asarray(vectors, float)
    return np.asarray(_alone(kind, vectors, view, PlaneParallel.load()))


def _radiance(kind: Kind, networks: PlaneParallel, view: View, vector):
    """Of one ray, and what else is told of it."""
    scene, ray = kind.scene(vector, networks), view[None]
    seen, clouds = see(scene, ray)
    parts = [x[:, 0] for x in (seen.reflective, seen.emissive) if x is not None]
    through = [
        way.passed.transmittance(way.layer.extinction_per_m)[0]
        for way in march_layers(scene, ray)
    ]
    told = jnp.stack(through), clouds.fraction[0], clouds.optical_depth[0]
    return jnp.concatenate(parts), told


@ft.partial(jax.jit, static_argnums=0)
def _alone(kind: Kind, vectors, view: View, networks):
    one = ft.partial(_radiance, kind, networks)
    return jax.vmap(lambda ray, vector: one(ray, vector)[0])(view, vectors)


@ft.partial(jax.jit, static_argnums=0)
def _forward(kind: Kind, vectors, tangents, view: View, networks):
    def one(ray, vector, tangent):
        own = ft.partial(_radiance, kind, networks, ray)
        radiance, forward, told = jax.jvp(own, (vector,), (tangent,), has_aux=True)
        return (radiance, told), forward

    return jax.vmap(one)(view, vectors, tangents)


@ft.partial(jax.jit, static_argnums=0)
def _reverse(kind: Kind, vectors, view: View, networks):
    def total(vector, ray):
        return _radiance(kind, networks, ray, vector)[0].sum()

    return jax.vmap(jax.grad(total))(vectors, view)
