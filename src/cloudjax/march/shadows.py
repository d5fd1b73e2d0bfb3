"""Shadows and sunny sides: what stands between the sun and the cloud that is seen.

A slab is lit as if its cloud went on for ever. What differs from that is the cloud on
the way to the sun from the cloud on the way to the viewer, altitude by altitude. With
the share b = (1 - ωg)/2 of what meets it that cloud sends back (two streams; Wiscombe &
Grams 1976), and the excess E = b (τ_sun - τ_own) of vertical optical depths above the
point where the light that is seen has turned, a cloud's own light is multiplied by

    1/(1 + E) where E > 0,    exp(-E) where E < 0.

The first is the transmittance of two streams. The second makes slopes that face the sun
brighter, much as a tilted slab is, by e at most. Nothing changes in a level cloud, and
nothing under the sun in the zenith for those who look straight down.
docs/theory/shadows.md has the derivation, what it was measured against, and the limits.
"""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from cloudjax.clouds.source import AbstractCloudSource
from cloudjax.geometry.path import Path

from .march import march
from .order import overlap


class Shadows(eqx.Module):
    """How shadows are looked for.

    **Fields:**

    - `steps`: towards the sun through each layer. They grow with the distance.
    - `reach_m`: how far at most.
    """

    steps: int = eqx.field(static=True, default=6)
    reach_m: float = eqx.field(static=True, default=50e3)

    def __check_init__(self):
        if self.steps < 1:
            raise ValueError("Shadows take a step at least: leave them out instead.")


class Passage(eqx.Module):
    """A way through a source of cloud, sampled.

    **Fields:**

    - `source`, `textures`: of cloud.
    - `way`, `samples`: what the source made of the rays.
    - `start_m`: as in `scene.View`.
    - `returned_per_m`: bβ in each reflective band.
    - `steps`: of the march.
    """

    source: AbstractCloudSource
    textures: PyTree
    way: PyTree
    samples: PyTree
    start_m: Float[Array, " rays"]
    returned_per_m: Float[Array, " bands"]
    steps: int = eqx.field(static=True)

    @property
    def path(self) -> Path:
        return self.way.path

    def at_altitudes_of(self, way: Path, steps: int) -> PyTree:
        """Its own samples at the altitudes of a way that its source was sampled on."""
        altitude = way.altitude_m(way.distance_m(steps))
        length = jnp.maximum(self.path.length_m, 1.0)[:, None]
        return self.samples.on(way, self.path.distance_to_m(altitude) / length)

    def turning_point_m(self) -> Float[Array, " rays"]:
        """The mean distance from the entry at which light turns: weights exp(-bτ)."""
        occupancy = self.source.occupancy(self.samples, self.steps)
        passed = march(occupancy, self.path.length_m)
        slant = jnp.abs(jnp.sum(self.path.direction * self.path.entry_up, axis=-1))
        returned = self.returned_per_m.mean() * slant[None, :, None] * passed.cloud_m
        weight = passed.mean(passed.segment_m * jnp.exp(-returned))
        total = jnp.maximum(weight.sum(-1), 1e-9)
        return jnp.sum(weight * self.path.distance_m(self.steps), axis=-1) / total


class Shade(eqx.Module):
    """Cloud of one source between a surface and the sun, and above it in its own pixel.

    **Fields:**

    - `rise_m`: altitude gained in each step.
    - `sunward`, `own`: samples at the same altitudes on the way to the sun, and on the
      ray that sees the surface.
    """

    rise_m: Float[Array, "rays steps"]
    sunward: PyTree
    own: PyTree

    def cloud_m(
        self, source: AbstractCloudSource
    ) -> tuple[
        Float[Array, "nodes rays"], Float[Array, "nodes rays"], Float[Array, " nodes"]
    ]:
        """Vertical length of the cloud on both ways, and the weights of the nodes."""
        steps = self.rise_m.shape[-1]
        sunward = source.occupancy(self.sunward, steps)
        own = source.occupancy(self.own, steps)
        rise = self.rise_m[None]
        lit = jnp.sum(sunward.fraction * rise, axis=-1)
        return lit, jnp.sum(own.fraction * rise, axis=-1), own.weights


class Shades(eqx.Module):
    """All shades of a set of rays, of each layer for each surface.

    **Fields:** `ways`: on the cloud of each way; `ground`: on what is below all cloud.
    """

    ways: tuple[tuple[Shade | None, ...], ...]
    ground: tuple[Shade | None, ...]


def find_shades(
    shadows: Shadows,
    passages: Sequence[Passage],
    layer_of: Sequence[int],
    sun_direction: Float[Array, "3"],
) -> Shades:
    """March from what the rays see towards the sun.

    **Arguments:** `layer_of`: the layer of each passage.
    """
    looked = [_Look(shadows, p, sun_direction) for p in passages]
    casters = [
        [k for k, layer in enumerate(layer_of) if layer == one]
        for one in range(max(layer_of, default=-1) + 1)
    ]
    on_ways, crossings = [], [0] * len(casters)
    for passage, layer in zip(passages, layer_of, strict=True):
        # Of layers that rays cross twice, that of the same crossing.
        crossing, crossings[layer] = crossings[layer], crossings[layer] + 1
        point, shell = passage.turning_point_m(), passage.source.shell
        on_ways.append(
            tuple(
                looked[of[crossing]].at(passage, point, near=overlap(shell, other))
                if (other := passages[of[crossing]].source.shell).top_m > shell.bottom_m
                else None
                for of in casters
            )
        )
    first = passages[0]
    ground = first.path.distance_to_m(jnp.zeros_like(first.start_m)[:, None])[:, 0]
    on_ground = tuple(looked[of[0]].at(first, ground, near=False) for of in casters)
    return Shades(tuple(on_ways), on_ground)


class _Look(eqx.Module):
    """Towards the sun through one source of cloud."""

    shadows: Shadows
    through: Passage
    sun: Float[Array, "3"]

    def at(self, seen: Passage, point_m: Float[Array, " rays"], *, near: bool) -> Shade:
        """From a point of another passage, or of this one.

        **Arguments:** `near`: whether the cloud may begin at the point itself.
        """
        mine, shell = self.through, self.through.source.shell
        here = seen.path.branch(point_m, self.sun, jnp.zeros_like(point_m)[:, None])
        low = jnp.maximum(here.entry_altitude_m, shell.bottom_m)
        levels = jnp.stack([low, jnp.full_like(low, shell.top_m)], axis=-1)
        reached = jnp.clip(here.distance_to_m(levels), 0, self.shadows.reach_m)
        # No part of a shell is on the way from above it, nor of one that is missed.
        reached = jnp.where(mine.path.length_m[:, None] > 0, reached, 0)
        steps = self.shadows.steps
        grown = (np.arange(steps + 1) / steps) ** (2 if near else 1)
        begin, end = reached[:, :1], jnp.maximum(reached[:, 1:], reached[:, :1])
        ends = begin + (end - begin) * grown[None]
        left = seen.start_m - mine.start_m + point_m
        branch = mine.source.branch(mine.way, left, self.sun, ends)
        sunward = mine.source.sample(
            branch, mine.textures, steps=steps, with_gradient=False
        )
        own = mine.at_altitudes_of(branch.path, steps)
        return Shade(jnp.diff(here.altitude_m(ends)), sunward, own)


def dimming(
    shades: Sequence[Shade | None],
    sources: Sequence[AbstractCloudSource],
    returned_per_m: Sequence[Float[Array, " bands"]],
    own: int | None = None,
) -> Float[Array, "bands #nodes rays"]:
    """What shades leave of the light of a surface.

    Of other layers, whose sub-pixel structure is their own, it is the mean
    transmittance on the way to the sun over that on the way to the viewer, for light
    has come the latter way in the slabs.

    **Arguments:** `sources`, `returned_per_m`: of each shade; `own`: the one that is of
    the surface's own cloud.
    """
    left = jnp.ones((1, 1, 1))
    for i, (shade, source, per_m) in enumerate(
        zip(shades, sources, returned_per_m, strict=True)
    ):
        if shade is None:
            continue
        sunward, above, weights = shade.cloud_m(source)
        turned = per_m[:, None, None]
        if i == own:
            left = left * _kept(turned * (sunward - above)[None])
        else:
            lit, seen = (
                jnp.einsum("n,bnr->br", weights, _kept(turned * cloud[None]))[:, None]
                for cloud in (sunward, above)
            )
            left = left * lit / seen
    return left


def _kept(excess: Float[Array, "*n"]) -> Float[Array, "*n"]:
    behind, ahead = jnp.maximum(excess, 0), jnp.minimum(excess, 0)
    return jnp.where(excess > 0, 1 / (1 + behind), jnp.exp(jnp.minimum(-ahead, 1)))
