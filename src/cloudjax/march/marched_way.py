"""The layers of a scene are marched, each along its own ways."""

import functools as ft
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from cloudjax.clouds.source import Occupancy
from cloudjax.geometry.path import Path, Profile
from cloudjax.light.emission import Factors

from .alike import Met, any_met, found_or_missed, if_met, nothing_like
from .march import March, march
from .order import AbstractPlace, Stretch, overlap, place
from .scene import Layer, Scene
from .view import View


# Where a layer's cloud is less likely there is none. The likelihood is that of one
# point. Columns, which have many points, and noise with long tails cover ten times as
# much.
LEAST_OF_LAYER = 1e-5


class MarchedWay(eqx.Module):
    """A `MarchedWay` is a way, and what the march along it met.

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
    met: Met
    path: Path
    start_m: Float[Array, " rays"]
    whole_m: Float[Array, " rays"]
    distance_m: Float[Array, "rays steps"]
    passed: March
    places: tuple[AbstractPlace | None, ...]
    air: Profile | None

    @property
    def part(self) -> Float[Array, "rays steps"]:
        """Say where the steps are on the whole way, 0 to 1."""
        distance = self.start_m[:, None] + self.distance_m
        return distance / jnp.maximum(self.whole_m, 1.0)[:, None]

    @property
    def air_k(self) -> Float[Array, "rays steps"] | None:
        """Give the air's temperature [K] at steps, None where the scene's serves."""
        return None if self.air is None else self.air.at(self.part)

    @property
    def altitude_m(self) -> Float[Array, "rays steps"]:
        """Give the altitude of the steps."""
        return self.path.altitude_m(self.distance_m)

    @property
    def view_height(self) -> Float[Array, " rays"]:
        """Give the cosine of the viewer's zenith angle at the entry."""
        return jnp.abs(jnp.sum(self.path.entry_up * self.path.direction, axis=-1))

    def stops(
        self, extinction_per_m: Float[Array, ""], factors: Factors | None = None
    ) -> "Stops":
        """Find what of the light looking back each step stops.

        **Arguments:** `factors`: what scattering changes of that.
        """

        def found(passed: March, per_m: Array, factors: Factors | None):
            absorbed, stopped = passed.absorbed(per_m), None
            if factors is not None:
                absorbed = absorbed * factors.emitted[..., None]
                stopped = factors.stopped
            return passed.mean(absorbed), passed.transmittance(per_m, stopped)

        operands = self.passed, extinction_per_m, factors
        return Stops(self.met, *if_met(self.met, found, (0.0, 1.0), *operands))

    def behind(
        self, others: Sequence["Stops"]
    ) -> list[Float[Array, "rays points"] | None]:
        """Find what each other way lets through in front of each step; None of itself.

        **Arguments:** `others`: of all ways.
        """
        return [
            None if where is None else where.through(some.through, self.met & some.met)
            for where, some in zip(self.places, others, strict=True)
        ]


class Stops(eqx.Module):
    """`Stops` are what each step of a way stops, the mean over sub-pixel structures.

    **Fields:**

    - `met`: whether cloud is likely on any ray.
    - `within`: the share of light that each step stops, with other ways taken away.
    - `through`: the transmittance from the entry to the ends of the steps.
    """

    met: Met
    within: Float[Array, "rays steps"]
    through: Float[Array, "rays ends"]


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
    return [
        MarchedWay(
            layer,
            any_met(shares[i]),
            path,
            begun[i],
            view.samples[i].path.length_m,
            distances[i],
            march(_occupancy(layer, samples, shares[i]), path.length_m),
            _places(i, layers, view.layer_of, stretches, distances[i]),
            None if view.air_k is None else view.air_k[i],
        )
        for i, (layer, samples, path) in enumerate(
            zip(layers, kept, paths, strict=True)
        )
    ]


def _places(
    i: int,
    layers: Sequence[Layer],
    layer_of: Sequence[int],
    stretches: Sequence[Stretch],
    distance_m: Float[Array, "rays steps"],
) -> tuple[AbstractPlace | None, ...]:
    """Where the steps of way i lie on each way; None of itself.

    **Arguments:** `layers`, `layer_of`, `stretches`: of every way. `distance_m`: of the
    steps of way i, from where its stretch begins.
    """
    shell = layers[i].cloud.shell

    def on(j: int) -> AbstractPlace | None:
        if i == j:
            return None
        # A ray that leaves a layer and meets it again has two ways through one shell,
        # which follow each other.
        other = layer_of[i] != layer_of[j]
        return place(
            stretches[j],
            layers[j].steps,
            stretches[i],
            distance_m,
            overlapping=other and overlap(shell, layers[j].cloud.shell),
        )

    return tuple(on(j) for j in range(len(stretches)))


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
    return found_or_missed(any_met(share), found, lambda _: missed, samples)


class Seen(eqx.Module):
    """`Seen` is what lines of sight meet of all ways, one in front of the other.

    **Fields:**

    - `stops`: of each way by itself.
    - `behind`: what each other way lets through in front of the steps of each.
    - `steps`: share of the light that each step of each way stops.
    """

    stops: list[Stops]
    behind: list[list[Float[Array, "rays points"] | None]]
    steps: list[Float[Array, "rays steps"]]


def seen(ways: Sequence[MarchedWay], stops: list[Stops]) -> Seen:
    """Put the ways in front of each other."""
    behind = [way.behind(stops) for way in ways]
    steps = [
        ft.reduce(jnp.multiply, (x for x in before if x is not None), own.within)
        for before, own in zip(behind, stops, strict=True)
    ]
    return Seen(stops, behind, steps)


def seen_first(ways: Sequence[MarchedWay]) -> Seen:
    """See the ways at the reference band."""
    return seen(ways, [way.stops(way.layer.extinction_per_m) for way in ways])


def top_altitude_m(ways: Sequence[MarchedWay], first: Seen) -> Float[Array, " rays"]:
    """Return the mean altitude of the first surface; 0 where nothing is met."""
    height = total = jnp.zeros_like(ways[0].path.length_m)
    for way, stopped in zip(ways, first.steps, strict=True):
        height = height + (stopped * way.altitude_m).sum(-1)
        total = total + stopped.sum(-1)
    met = total > 1e-3
    return jnp.where(met, height / jnp.where(met, total, 1.0), 0.0)
