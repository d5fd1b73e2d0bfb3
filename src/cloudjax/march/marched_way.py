"""The layers of a scene, each marched along its own ways."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from cloudjax.geometry.path import Path

from .march import March, march
from .order import AbstractPlace, Stretch, overlap, place
from .scene import Layer, Scene
from .view import View


class MarchedWay(eqx.Module):
    """A way, marched.

    **Fields:** `places`: where its steps lie on each of the other ways.
    """

    layer: Layer
    path: Path
    distance_m: Float[Array, "rays steps"]
    air_k: Float[Array, "rays steps"] | None
    passed: March
    places: tuple[AbstractPlace | None, ...]

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
        return clear


def march_layers(scene: Scene, view: View) -> list[MarchedWay]:
    """March every way of a view, and find where each lies on the others."""
    layers = [scene.layers[i] for i in view.layer_of]
    paths = [samples.path for samples in view.samples]
    distances = [
        path.distance_m(layer.steps) for layer, path in zip(layers, paths, strict=True)
    ]
    stretches = [
        Stretch(start, path.length_m)
        for start, path in zip(view.start_m, paths, strict=True)
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
            path,
            distances[i],
            None if view.air_k is None else view.air_k[i].in_steps(layer.steps),
            march(layer.cloud.occupancy(samples, layer.steps), path.length_m),
            tuple(places(i)),
        )
        for i, (layer, samples, path) in enumerate(
            zip(layers, view.samples, paths, strict=True)
        )
    ]


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
