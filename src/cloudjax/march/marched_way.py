"""The layers of a scene, each marched along its own ways."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from cloudjax.clouds.source import Occupancy
from cloudjax.geometry.path import Path, Profile

from .alike import nothing_like
from .march import March, march
from .order import AbstractPlace, Stretch, overlap, place
from .scene import Layer, Scene
from .view import View


# Where a layer's cloud is less likely there is none. The likelihood is that of a point;
# a column of many, and noise with long tails, cover ten times as much.
LEAST_OF_LAYER = 1e-6


class MarchedWay(eqx.Module):
    """A way, marched.

    **Fields:**

    - `met`: whether cloud is likely on any ray.
    - `path`: of the part of the way on which there can be cloud; `start_m`: how far
      from the entry it begins, and `whole_m`: how long the whole way is.
    - `distance_m`: of its steps, from there.
    - `passed`: what they met.
    - `places`: where its steps lie on each of the other ways.
    - `air`: temperature [K] along the whole way, None where the scene's serves.
    """

    layer: Layer
    met: Bool[Array, ""]
    path: Path
    start_m: Float[Array, " rays"]
    whole_m: Float[Array, " rays"]
    distance_m: Float[Array, "rays steps"]
    passed: March
    places: tuple[AbstractPlace | None, ...]
    air: Profile | None

    @property
    def part(self) -> Float[Array, "rays steps"]:
        """Where the steps are on the whole way, 0 to 1."""
        distance = self.start_m[:, None] + self.distance_m
        return distance / jnp.maximum(self.whole_m, 1.0)[:, None]

    @property
    def air_k(self) -> Float[Array, "rays steps"] | None:
        return None if self.air is None else self.air.at(self.part)

    @property
    def altitude_m(self) -> Float[Array, "rays steps"]:
        return self.path.altitude_m(self.distance_m)

    @property
    def view_height(self) -> Float[Array, " rays"]:
        """Cosine of the viewer's zenith angle at the entry."""
        return jnp.abs(jnp.sum(self.path.entry_up * self.path.direction, axis=-1))

    def unhidden(
        self, profiles: Sequence[Float[Array, "rays nodes"]]
    ) -> Float[Array, "rays points"]:
        """Transmittance of all other ways in front of each step."""
        clear = jnp.ones_like(self.path.length_m)[:, None]
        for where, profile in zip(self.places, profiles, strict=True):
            if where is not None:
                clear = clear * where.read(profile)
        # XLA would read all profiles anew for each use.
        return jax.lax.optimization_barrier(clear)


def march_layers(scene: Scene, view: View) -> list[MarchedWay]:
    """March every way of a view, and find where each lies on the others."""
    shares = shares_of_ways(scene, view.samples, view.layer_of)
    layers = [scene.layers[i] for i in view.layer_of]
    kept, begun = zip(
        *(
            layer.cloud.narrowed(samples, layer.steps)
            for layer, samples in zip(layers, view.samples, strict=True)
        ),
        strict=True,
    )
    paths = [samples.path for samples in kept]
    distances = [
        path.distance_m(layer.steps) for layer, path in zip(layers, paths, strict=True)
    ]
    stretches = [
        Stretch(start + first, path.length_m)
        for start, first, path in zip(view.start_m, begun, paths, strict=True)
    ]

    def places(i):
        for j, stretch in enumerate(stretches):
            same = view.layer_of[i] == view.layer_of[j]
            shells = layers[i].cloud.shell, layers[j].cloud.shell
            yield (
                None
                if i == j
                else place(
                    stretch,
                    layers[j].steps,
                    stretches[i],
                    distances[i],
                    overlapping=not same and overlap(*shells),
                )
            )

    return [
        MarchedWay(
            layer,
            (shares[i] > 0).any(),
            path,
            begun[i],
            view.samples[i].path.length_m,
            distances[i],
            march(_occupancy(layer, samples, shares[i]), path.length_m),
            tuple(places(i)),
            None if view.air_k is None else view.air_k[i],
        )
        for i, (layer, samples, path) in enumerate(
            zip(layers, kept, paths, strict=True)
        )
    ]


def shares_of_ways(
    scene: Scene,
    samples: Sequence[Any],
    layer_of: Sequence[int],
    least: float = LEAST_OF_LAYER,
) -> list[Float[Array, " rays"]]:
    """Tell where each way has cloud: 1 where that is likely, 0 where it is not.

    It rises smoothly in between, so that radiances have no jumps.

    **Arguments:** `samples`: of each way, or the ways themselves. `least`: likelihood
    from which on it is 1; up to half of it it is 0.
    """
    chances = [
        scene.layers[i].cloud.likelihood(some)
        for i, some in zip(layer_of, samples, strict=True)
    ]
    parts = [jnp.clip(2 * chance / least - 1, 0, 1) for chance in chances]
    return [x * x * (3 - 2 * x) for x in parts]


def _occupancy(layer: Layer, samples: Any, share: Float[Array, " rays"]) -> Occupancy:
    """The cloud of a way, none where it has no share."""

    def found(some) -> Occupancy:
        occupancy = layer.cloud.occupancy(some, layer.steps)
        faded = occupancy.fraction * share[None, :, None]
        return replace(occupancy, fraction=faded)

    # Weights of nothing add up to one as well.
    none = nothing_like(found, samples)
    weights = jnp.full_like(none.weights, 1 / none.weights.shape[0])
    missed = replace(none, weights=weights)
    return jax.lax.cond((share > 0).any(), found, lambda _: missed, samples)


def stopped_light(ways: Sequence[MarchedWay]) -> list[Float[Array, "rays steps"]]:
    """Share of the light looking back that each step of each way stops."""
    profiles = [way.passed.transmittance(way.layer.extinction_per_m) for way in ways]
    return [
        way.passed.mean(way.passed.absorbed(way.layer.extinction_per_m))
        * way.unhidden(profiles)
        for way in ways
    ]


def top_altitude_m(ways: Sequence[MarchedWay]) -> Float[Array, " rays"]:
    """Mean altitude of the first surface; 0 where nothing is met."""
    height = total = jnp.zeros_like(ways[0].path.length_m)
    for way, stopped in zip(ways, stopped_light(ways), strict=True):
        height = height + (stopped * way.altitude_m).sum(-1)
        total = total + stopped.sum(-1)
    met = total > 1e-3
    return jnp.where(met, height / jnp.where(met, total, 1.0), 0.0)
