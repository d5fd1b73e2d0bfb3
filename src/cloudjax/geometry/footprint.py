"""A pixel averages over an ellipsoid about its line of sight."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .arrays import HostArray, namespace
from .geodesy import GRS80, Ellipsoid, dot, vertical
from .on_host import compiled_for_many
from .rays import Rays
from .shells import Shell, both_chords


# A footprint's length over its width goes to infinity at the limb, so it is cut off. It
# reaches 6 where the line of sight is 10 degrees above the horizon.
_LONGEST = 6.0
# An average over the whole of the box takes too much of the vertical structure that the
# ray resolves: measured against many hard rays per pixel (docs/decisions.md).
_SHARPNESS = 0.8
# Way over the ground within which winds and masks are as good as linear, and the knots
# of longer ways.
_KNOT_SPACING_M = 60e3
_MANY_KNOTS = 9
# Stands in rows of `kinds` for the stretch of rays at the limb.
_LIMB = 10
# Widths of a group of rays agree within a factor of 2. The usual pixels from
# geostationary orbit, 0.5 to 10 km at nadir, are in one group each.
_LEAST_WIDTH_M = 1.5


class Footprint(eqx.Module):
    """A `Footprint` is the Gaussian that a pixel averages over, on each ray.

    It has the variances of a box, width²/12, times 0.64. It is as thick upwards as
    across: waves much shorter than the pixel that survive an average over its level
    surface alone are too few to matter.

    **Fields:** `across_m`, `along_m`: standard deviations across and along the
    direction of view.
    """

    across_m: Float[Array, " rays"]
    along_m: Float[Array, " rays"]

    @staticmethod
    def level(width_m, stretch, step_m: Any = 0.0) -> "Footprint":
        """Find it for pixels on a level surface.

        **Arguments:**

        - `width_m`: across the direction of view.
        - `stretch`: length over width, `stretch_of` a ray.
        - `step_m`: of the march. A step longer than the pixel averages as well.
        """
        across, step = across_m(width_m), across_m(step_m)
        return Footprint(across, jnp.sqrt((across * stretch) ** 2 + step**2))


def across_m(width_m):
    """Return the standard deviation [m] of the average over a width [m]."""
    return _SHARPNESS / np.sqrt(12) * width_m


def stretch_of(slant):
    """Return a pixel's length over its width, from the cosine of ray and vertical."""
    return jnp.minimum(1 / jnp.maximum(jnp.abs(slant), 1e-9), _LONGEST)


@dataclass(frozen=True)
class Sampling:
    """A `Sampling` says how densely clouds are read along the rays of one group, and
    how that is held.

    What rays of different groups need can be joined only where it is held at the same
    points. All ways of holding are exact: the march sees the same values.

    **Fields:**

    - `finest_m`: the least width of a pixel.
    - `stretch`: the greatest length of a way over the depth that it crosses; infinite
      at the limb.
    - `knots`: points of a chord at which masks and winds are read, linear in between.
    - `held_knots`: at which masks are held.
    - `held_finest_m`: the least width of a pixel of all groups that are held alike, at
      every step of the march; None where a group is held alone.
    - `strains`: whether it is asked how the wind has strained the air, as slopes and
      shadows ask.
    """

    finest_m: float
    stretch: float = 1.0
    knots: int = 2
    held_knots: int = 2
    held_finest_m: float | None = None
    strains: bool = True

    def way_m(self, depth_m: float) -> float:
        """Return how long [m] a chord through a layer of air can be."""
        return depth_m * self.stretch

    def through(self, depth_m: float) -> "Sampling":
        """Return the sampling that a layer of air needs: short ways have two knots."""
        long = self.way_m(depth_m) > _KNOT_SPACING_M
        return self if long else replace(self, knots=min(self.knots, 2))


@dataclass(frozen=True)
class Kind:
    """Rays of one kind are read alike.

    **Fields:**

    - `finest_m`, `stretch`: as in `Sampling`; within a factor of 2.
    - `knots`: points of a chord between which winds and masks are taken for linear; 0
      of rays that miss all air.
    - `twice`: whether they cross a shell a second time.
    """

    finest_m: float
    stretch: float
    knots: int = 2
    twice: bool = False

    @property
    def sampling(self) -> Sampling:
        """Give the sampling that rays of this kind alone need."""
        return Sampling(self.finest_m, self.stretch, self.knots, self.knots)


@compiled_for_many("shell", "layers", "ellipsoid")
def kinds(
    rays: Rays,
    shell: Shell,
    layers: tuple[Shell, ...] = (),
    ellipsoid: Ellipsoid = GRS80,
) -> Int[HostArray, "rays 4"]:
    """Sort rays into kinds by width, stretch, knots and second chords.

    `kind_of` reads a row. A ray's kind depends on nothing but the ray.

    **Arguments:**

    - `shell`: the air that holds all cloud.
    - `layers`: the shells within it. A ray that never leaves that air may cross one of
      them a second time.
    """
    xp = namespace(rays.direction)
    chord, again = both_chords(rays, shell, ellipsoid)
    middle = chord.entry_m + chord.length_m / 2
    upward, _ = vertical(rays.at(middle), ellipsoid)
    slant = dot(upward, rays.direction)
    width = rays.pixel_rad * xp.maximum(middle, 1.0)
    stretch = xp.minimum(1 / xp.maximum(xp.abs(slant), 1e-9), _LONGEST)
    level = xp.sqrt(xp.maximum(1 - slant**2, 1e-12))
    far = xp.maximum(chord.length_m, again.length_m) * level
    twice = again.length_m > 0
    # The shell of a single layer is that of all air, which has been looked at above.
    for layer in layers if len(layers) > 1 else ():
        twice = twice | (both_chords(rays, layer, ellipsoid)[1].length_m > 0)
    return xp.stack(
        [
            xp.floor(xp.log2(xp.maximum(width / _LEAST_WIDTH_M, 1.0))),
            xp.where(
                stretch < _LONGEST, xp.ceil(xp.log2(stretch) - 1e-9), float(_LIMB)
            ),
            xp.where(far > _KNOT_SPACING_M, _MANY_KNOTS, 2) * (chord.length_m > 0),
            twice,
        ],
        axis=-1,
    ).astype(np.int16)


def kind_of(row: Int[np.ndarray, "4"]) -> Kind:
    """Return the kind of a row of `kinds`."""
    width, octaves, knots, twice = row.tolist()
    stretch = np.inf if octaves == _LIMB else 2.0**octaves
    return Kind(_LEAST_WIDTH_M * 2.0**width, stretch, knots, bool(twice))


def grouped(
    rows: Int[np.ndarray, "rays 4"],
) -> Iterator[tuple[Kind, Int[np.ndarray, " members"]]]:
    """Yield each kind of ray with the numbers of its rays, by rows of `kinds`."""
    # Each row is packed into one number: rows would be sorted twenty times as slowly.
    packed = rows.astype(np.int64) @ np.array([4096, 64, 2, 1])
    found, first, which = np.unique(packed, return_index=True, return_inverse=True)
    for i, _ in enumerate(found):
        yield kind_of(rows[first[i]]), np.flatnonzero(which == i)
