"""Shadows and sunny sides are what stands between the sun and the cloud that is seen.

A slab is lit as if its cloud went on for ever. What differs from that is the cloud on
the way to the sun from the cloud on the way to the viewer, altitude by altitude. With
the share b = (1 - ωg)/2 of what meets it that cloud sends back (two streams; Wiscombe &
Grams 1976), and the excess E = b (τ_sun - τ_own) of vertical optical depths above the
point where the light that is seen has turned, a cloud's own light is multiplied by

    1/(1 + E) where E > 0,    exp(-E) where E < 0.

The first is the transmittance of two streams. The second makes slopes that face the sun
brighter, much as a tilted slab is, by e at most. Nothing changes in a level cloud, and
nothing under the sun in the zenith for those who look straight down.

Where light turns depends on the clouds, and a view on geometry alone. So the clouds
are sampled towards the sun from a few points of each ray, and both depths are linear in
between. docs/theory/shadows.md has the derivation, what it was measured against, and
the limits.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from cloudjax.clouds.source import AbstractCloudSource
from cloudjax.geometry.path import Path

from .order import overlap


class Shadows(eqx.Module):
    """`Shadows` say how shadows are looked for.

    **Fields:**

    - `steps`: towards the sun through each layer. They grow with the distance.
    - `reach_m`: how far at most.
    - `points`: of each ray's way through a layer, its ends among them, from which the
      clouds towards the sun are sampled.
    """

    steps: int = eqx.field(static=True, default=6)
    reach_m: float = eqx.field(static=True, default=50e3)
    points: int = eqx.field(static=True, default=5)

    def __check_init__(self):
        if self.steps < 1:
            raise ValueError("Shadows take a step at least: leave them out instead.")
        if self.points < 2:
            raise ValueError("Shadows are found at both ends of a way: give 2 points.")


class Passage(eqx.Module):
    """A `Passage` is a way through a source of cloud, sampled.

    **Fields:**

    - `source`, `textures`: of cloud.
    - `way`, `samples`: what the source made of the rays.
    - `start_m`: as in `view.View`.
    """

    source: AbstractCloudSource
    textures: Any
    way: Any
    samples: Any
    start_m: Float[Array, " rays"]

    @property
    def path(self) -> Path:
        """Give the geometry."""
        return self.way.path

    def repeated(self, times: int) -> "Passage":
        """Take every ray so many times in a row."""
        way, samples, start = jax.tree.map(
            lambda x: jnp.repeat(x, times, axis=0),
            (self.way, self.samples, self.start_m),
        )
        return Passage(self.source, self.textures, way, samples, start)

    def between_altitudes(self, levels_m: Float[Array, "rays ends"]) -> Any:
        """Read its own samples where the ray is between levels that it passes."""
        ends = jnp.clip(
            self.path.distance_to_m(levels_m), 0, self.path.length_m[:, None]
        )
        path = replace(self.path, ends_m=ends)
        length = jnp.maximum(self.path.length_m, 1.0)[:, None]
        return self.samples.on(path, path.distance_m(ends.shape[-1] - 1) / length)


class Shade(eqx.Module):
    """A `Shade` is the cloud of one source between points of a surface and the sun, and
    above them.

    **Fields:**

    - `rise_m`: altitude gained in each step from each point.
    - `own_rise_m`: as much of it as the ray passes. A viewer within or below the cloud
      sees the surface through what lies between the two only.
    - `sunward`, `own`: samples at the same altitudes on the way to the sun, and on the
      ray that sees the surface; the points are the second axis of every leaf.
    """

    rise_m: Float[Array, "rays points steps"]
    own_rise_m: Float[Array, "rays points steps"]
    sunward: Any
    own: Any

    def cloud_m(
        self, source: AbstractCloudSource
    ) -> tuple[
        Float[Array, "nodes rays points"],
        Float[Array, "nodes rays points"],
        Float[Array, " nodes"],
    ]:
        """Add up the vertical length of cloud on both ways; weights of the nodes."""
        rays, points, steps = self.rise_m.shape

        def length(samples, rise_m):
            flat = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), samples)
            found = source.occupancy(flat, steps)
            total = jnp.sum(found.fraction * rise_m.reshape(1, -1, steps), axis=-1)
            return total.reshape(-1, rays, points), found.weights

        lit, weights = length(self.sunward, self.rise_m)
        above, _ = length(self.own, self.own_rise_m)
        return lit, above, weights


class Shades(eqx.Module):
    """`Shades` are all shades of a set of rays, of each layer for each surface.

    **Fields:** `ways`: on the cloud of each way; `ground`: on what is below all cloud.
    """

    ways: tuple[tuple[Shade | None, ...], ...]
    ground: tuple[Shade | None, ...]


def find_shades(
    shadows: Shadows,
    passages: Sequence[Passage],
    layer_of: Sequence[int],
    sun_direction: Float[Array, "rays 3"],
) -> Shades:
    """Sample the clouds from what the rays see towards the sun.

    **Arguments:** `layer_of`: the layer of each passage.
    """
    looked = [_Look(shadows, p, sun_direction) for p in passages]
    casters = [
        [k for k, layer in enumerate(layer_of) if layer == one]
        for one in range(max(layer_of, default=-1) + 1)
    ]
    parts = np.linspace(0, 1, shadows.points)
    on_ways, crossings = [], [0] * len(casters)
    for passage, layer in zip(passages, layer_of, strict=True):
        # Of layers that rays cross twice, that of the same crossing.
        crossing, crossings[layer] = crossings[layer], crossings[layer] + 1
        places = passage.path.length_m[:, None] * parts[None].astype(np.float32)
        on_ways.append(
            tuple(looked[of[crossing]].on_cloud(passage, places) for of in casters)
        )
    first = passages[0]
    ground = first.path.distance_to_m(jnp.zeros_like(first.start_m)[:, None])
    on_ground = tuple(looked[of[0]].at(first, ground, near=False) for of in casters)
    return Shades(tuple(on_ways), on_ground)


class _Look(eqx.Module):
    """Towards the sun through one source of cloud."""

    shadows: Shadows
    through: Passage
    sun: Float[Array, "rays 3"]

    def on_cloud(
        self, seen: Passage, points_m: Float[Array, "rays points"]
    ) -> Shade | None:
        """Sample from points in the cloud of a passage; None where it is above."""
        shell, caster = seen.source.shell, self.through.source.shell
        if caster.top_m <= shell.bottom_m:
            return None
        return self.at(seen, points_m, near=overlap(shell, caster))

    def at(
        self, seen: Passage, points_m: Float[Array, "rays points"], *, near: bool
    ) -> Shade:
        """Sample from points of another passage, or of this one.

        **Arguments:** `near`: whether the cloud may begin at the points themselves.
        """
        rays, points = points_m.shape
        mine, seen = self.through.repeated(points), seen.repeated(points)
        sun, point = jnp.repeat(self.sun, points, axis=0), points_m.reshape(-1)
        steps, shell = self.shadows.steps, mine.source.shell
        here = seen.path.branch(point, sun, jnp.zeros_like(point)[:, None])
        ends = self._ends(here, mine.path, shell, near=near)
        left = seen.start_m - mine.start_m + point
        branch = mine.source.branch(mine.way, mine.textures, left, sun, ends)
        sunward = mine.source.sample(branch, mine.textures, steps=steps, slopes=False)
        levels = here.altitude_m(ends)
        passed = levels_passed_m(levels, mine.path)
        own = mine.between_altitudes(passed)
        rises = jnp.diff(levels), jnp.diff(passed)
        parts = jax.tree.map(
            lambda x: x.reshape(rays, points, *x.shape[1:]), (*rises, sunward, own)
        )
        return Shade(*parts)

    def _ends(self, here: Path, through: Path, shell, *, near: bool):
        """Distances from the points at which steps towards the sun begin and end."""
        low = jnp.maximum(here.entry_altitude_m, shell.bottom_m)
        levels = jnp.stack([low, jnp.full_like(low, shell.top_m)], axis=-1)
        reached = jnp.clip(here.distance_to_m(levels), 0, self.shadows.reach_m)
        # No part of a shell is on the way from above it, nor of one that is missed.
        reached = jnp.where(through.length_m[:, None] > 0, reached, 0)
        steps = self.shadows.steps
        grown = (np.arange(steps + 1) / steps) ** (2 if near else 1)
        begin, end = reached[:, :1], jnp.maximum(reached[:, 1:], reached[:, :1])
        return begin + (end - begin) * grown[None].astype(np.float32)


def levels_passed_m(
    levels_m: Float[Array, "rays ends"], path: Path
) -> Float[Array, "rays ends"]:
    """Move levels that a path does not reach to the nearest that it does."""
    turn = -path.radius_m * jnp.sum(path.direction * path.entry_up, axis=-1)
    ends = jnp.stack([jnp.zeros_like(turn), turn, path.length_m], axis=-1)
    at = path.altitude_m(jnp.clip(ends, 0, path.length_m[:, None]))
    return jnp.clip(levels_m, at.min(-1)[:, None], at.max(-1)[:, None])


def dimming(
    shades: Sequence[Shade | None],
    sources: Sequence[AbstractCloudSource],
    returned_per_m: Sequence[Float[Array, " bands"]],
    own: int | None = None,
    part: Float[Array, " rays"] | None = None,
) -> Float[Array, "bands #nodes rays"]:
    """Find what shades leave of the light of a surface.

    Of other layers, whose sub-pixel structure is their own, it is the mean
    transmittance on the way to the sun over that on the way to the viewer, for light
    has come the latter way in the slabs.

    **Arguments:**

    - `sources`, `returned_per_m`: of each shade.
    - `own`: the one that is of the surface's own cloud.
    - `part`: of the ray's way through the cloud, 0 to 1, at which the light turns; None
      for surfaces of one point.
    """
    left = jnp.ones((1, 1, 1))
    for i, (shade, source, per_m) in enumerate(
        zip(shades, sources, returned_per_m, strict=True)
    ):
        if shade is None:
            continue
        *lengths, weights = shade.cloud_m(source)
        sunward, above = (_between(length, part) for length in lengths)
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


def _between(
    length_m: Float[Array, "nodes rays points"], part: Float[Array, " rays"] | None
) -> Float[Array, "nodes rays"]:
    """Linear between points equally far apart."""
    last = length_m.shape[-1] - 1
    if part is None or last == 0:
        return length_m[..., 0]
    total = jnp.zeros(length_m.shape[:-1], length_m.dtype)
    for i in range(last + 1):
        share = jnp.maximum(1 - jnp.abs(jnp.clip(part, 0, 1) * last - i), 0)
        total = total + share[None] * length_m[..., i]
    return total


def _kept(excess: Float[Array, "*n"]) -> Float[Array, "*n"]:
    behind, ahead = jnp.maximum(excess, 0), jnp.minimum(excess, 0)
    return jnp.where(excess > 0, 1 / (1 + behind), jnp.exp(jnp.minimum(-ahead, 1)))
