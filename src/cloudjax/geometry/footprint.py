"""A pixel averages over an ellipsoid about its line of sight.

All rays of one image are sorted into a few kinds of footprint, whose textures are
averaged once. The kinds are cells of a fixed grid in size and orientation, so that the
same pixel gets the same textures however an image is cut into tiles.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from .geodesy import GRS80, Ellipsoid, dot, vertical
from .rays import Rays
from .shells import Shell, both_chords, meets_ground


# Widths of one kind agree within a factor of √2, lengths over widths within 2, and
# where these are not 1 directions within 36 degrees. Many more kinds gain nothing,
# fewer lose (docs/decisions.md).
_WIDTHS_PER_OCTAVE = 2.0
_STRETCHES_PER_OCTAVE = 1.0
_DIRECTIONS = np.array(
    [
        *((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        *((1, 1, 0), (1, -1, 0), (1, 0, 1), (1, 0, -1), (0, 1, 1), (0, 1, -1)),
    ]
)
# At the limb a footprint has no end. 6 times its width is 10 degrees above it.
_LONGEST = 6.0
# An average over the whole of the box takes too much of the vertical structure that the
# ray resolves: measured against many hard rays per pixel (docs/decisions.md).
_SHARPNESS = 0.8
# Of an averaged texture: the Gaussian is down to 1/60 at two voxels per wave.
_VOXELS_PER_WIDTH = 4.0
# Way over the ground within which winds and masks are as good as linear, and the knots
# of longer ways.
_KNOT_SPACING_M = 60e3
_MANY_KNOTS = 9


@dataclass(frozen=True)
class Footprint:
    """A `Footprint` is one kind of pixel, by its size and direction.

    A ray passes over the structure within its pixel at all heights, but textures are as
    blunt upwards as across: waves much shorter than the pixel that survive an average
    over its level surface alone are too few to matter, and without them a texture needs
    no more voxels than pixels (docs/decisions.md).

    **Fields:**

    - `width_m`: across the direction of view, and upwards.
    - `length_m`: along the direction of view, on a level surface.
    - `along`: that direction, unit vector, ECEF.
    """

    width_m: float
    length_m: float
    along: tuple[float, float, float] = (1.0, 0.0, 0.0)

    @property
    def covariance_m2(self) -> Float[np.ndarray, "3 3"]:
        """Give the covariance [m²] of the Gaussian average: 0.64 of that of a uniform
        box of these lengths, which is width²/12.
        """
        along = np.array(self.along)
        longer = self.length_m**2 - self.width_m**2
        box = (self.width_m**2 * np.eye(3) + longer * np.outer(along, along)) / 12
        return _SHARPNESS**2 * box

    @property
    def spacing_m(self) -> float:
        """Give the spacing [m] of voxels between which the averaged texture is as good
        as linear.
        """
        return self.width_m / _VOXELS_PER_WIDTH

    @property
    def slant(self) -> float:
        """Give the cosine of the angle between ray and vertical."""
        return self.width_m / self.length_m if self.length_m else 1.0

    @property
    def view(self) -> Float[np.ndarray, "3"]:
        """Give a unit vector that stands to `along` as the rays of this kind do."""
        along = np.array(self.along)
        upward = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
        upward /= np.linalg.norm(upward)
        return self.slant * upward - np.sqrt(1 - self.slant**2) * along


POINT = Footprint(0.0, 0.0)


@dataclass(frozen=True)
class Sampling:
    """A `Sampling` says how densely clouds are read along rays of one kind, and how
    that is held.

    What rays of different kinds need can be joined only where it is held at the same
    points. All ways of holding are exact: the march sees the same values.

    **Fields:**

    - `footprint`: of the pixels.
    - `knots`: points of a chord at which masks and winds are read, linear in between.
    - `held_knots`: at which masks are held.
    - `at_steps`: whether what textures gave is held at every step of the march.
    """

    footprint: Footprint
    knots: int = 2
    held_knots: int = 2
    at_steps: bool = False


@dataclass(frozen=True)
class Kind:
    """Rays of one kind are marched alike.

    **Fields:**

    - `footprint`: of their pixels.
    - `knots`: points of a chord between which winds and masks are taken for linear; 0
      of rays that miss all air.
    - `twice`: whether they cross a shell a second time.
    """

    footprint: Footprint
    knots: int = 2
    twice: bool = False

    @property
    def sampling(self) -> Sampling:
        """Give the sampling that rays of this kind alone need."""
        return Sampling(self.footprint, self.knots, self.knots)


def kinds(
    rays: Rays,
    shell: Shell,
    layers: Sequence[Shell] = (),
    ellipsoid: Ellipsoid = GRS80,
) -> Int[np.ndarray, "rays 7"]:
    """Sort rays into kinds, each a cell of the fixed grid; `kind_of` reads a row.

    **Arguments:**

    - `shell`: the air that holds all cloud.
    - `layers`: the shells within it. A ray that never leaves that air may cross one of
      them a second time.
    """
    chord, again = both_chords(rays, shell, ellipsoid)
    middle = chord.entry_m + chord.length_m / 2
    upward, _ = vertical(rays.at(middle), ellipsoid)
    slant = dot(upward, rays.direction)
    width = rays.pixel_rad * np.maximum(middle, 1.0)
    stretch = np.minimum(1 / np.maximum(np.abs(slant), 1e-9), _LONGEST)
    rung = np.round(_STRETCHES_PER_OCTAVE * np.log2(stretch))
    level = np.sqrt(np.maximum(1 - slant**2, 1e-12))
    along = (rays.direction - slant[:, None] * upward) / level[:, None]
    far = np.maximum(chord.length_m, again.length_m) * level
    return np.stack(
        [
            np.round(_WIDTHS_PER_OCTAVE * np.log2(width)),
            rung,
            *np.where(rung > 0, _nearest_direction(along).T, 0),
            np.where(far > _KNOT_SPACING_M, _MANY_KNOTS, 2) * (chord.length_m > 0),
            (again.length_m > 0) | _crosses_twice(rays, layers, ellipsoid),
        ],
        axis=-1,
    ).astype(np.int64)


def _crosses_twice(
    rays: Rays, layers: Sequence[Shell], ellipsoid: Ellipsoid
) -> Bool[np.ndarray, " rays"]:
    twice = np.zeros(len(rays), bool)
    if len(layers) < 2:
        # One layer is all of the air.
        return twice
    passing = np.flatnonzero(~meets_ground(rays, ellipsoid))
    for layer in layers:
        again = both_chords(rays[passing], layer, ellipsoid)[1]
        twice[passing] |= again.length_m > 0
    return twice


def kind_of(row: Int[np.ndarray, "7"]) -> Kind:
    """Return the kind at the middle of a cell."""
    width = 2.0 ** (row[0] / _WIDTHS_PER_OCTAVE)
    if row[1] == 0:
        footprint = Footprint(float(width), float(width))
    else:
        stretch = 2.0 ** (row[1] / _STRETCHES_PER_OCTAVE)
        along = row[2:5] / np.linalg.norm(row[2:5])
        footprint = Footprint(
            float(width), float(width * stretch), tuple(along.tolist())
        )
    return Kind(footprint, int(row[5]), bool(row[6]))


def _nearest_direction(
    along: Float[np.ndarray, "rays 3"],
) -> Int[np.ndarray, "rays 3"]:
    """A direction is the same forwards and backwards."""
    axes = _DIRECTIONS / np.linalg.norm(_DIRECTIONS, axis=-1, keepdims=True)
    return _DIRECTIONS[np.abs(along @ axes.T).argmax(-1)]


def grouped(
    rows: Int[np.ndarray, "rays 7"],
) -> Iterator[tuple[Kind, Int[np.ndarray, " members"]]]:
    """Yield each kind of ray with the numbers of its rays, by rows of `kinds`."""
    # One number per row: rows themselves sort twenty times as slowly.
    low, high = rows.min(0).astype(np.int64), rows.max(0).astype(np.int64)
    sizes = high - low + 1
    packed = np.ravel_multi_index(tuple((rows - low).T), tuple(sizes))
    found, counts = np.unique(packed, return_counts=True)
    order = np.argsort(packed, kind="stable")
    found = np.stack(np.unravel_index(found, tuple(sizes)), axis=-1) + low
    members = np.split(order, np.cumsum(counts)[:-1])
    for row, some in zip(found, members, strict=True):
        yield kind_of(row), some
