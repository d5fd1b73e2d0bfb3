"""What a pixel averages: an ellipse on the level surface, seen along its ray.

All rays of one image are sorted into a few kinds of footprint, whose textures are
averaged once. The kinds are cells of a fixed grid in size and orientation, so that the
same pixel gets the same textures however an image is cut into tiles.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from .geodesy import GRS80, Ellipsoid, geodetic, up
from .rays import Rays
from .shell import Shell, chords, second_chords


# Widths of one kind agree within a factor of √2, lengths over widths within 1.6,
# verticals within some 14 degrees, directions within 23 where that is above 1.27.
_WIDTHS_PER_OCTAVE = 2.0
_STRETCHES_PER_OCTAVE = 1.5
_VERTICAL_CELL = 0.5
_DIRECTIONS = 4
# At the limb a footprint has no end. 6 times its width is 10 degrees above it.
_LONGEST = 6.0
# Way over the ground within which winds and masks are as good as linear, and the knots
# of longer ways.
_KNOT_SPACING_M = 60e3
_MANY_KNOTS = 9


@dataclass(frozen=True)
class Footprint:
    """A kind of pixel.

    **Fields:**

    - `width_m`, `length_m`: across and along the direction of view, on a level surface.
    - `vertical`, `along`: the axes of that surface, unit vectors, ECEF; of the ellipse.
    - `slant`: cosine of the ray to the vertical.
    """

    width_m: float
    length_m: float
    vertical: tuple[float, float, float] = (0.0, 0.0, 1.0)
    along: tuple[float, float, float] = (1.0, 0.0, 0.0)
    slant: float = 1.0

    @property
    def covariance_m2(self) -> Float[np.ndarray, "3 3"]:
        """Of a uniform box with the widths of the ellipse: width²/12 on each axis."""
        along = np.array(self.along)
        across = np.cross(self.vertical, along)
        return (
            self.length_m**2 * np.outer(along, along)
            + self.width_m**2 * np.outer(across, across)
        ) / 12

    @property
    def view(self) -> Float[np.ndarray, "3"]:
        """A direction of view of that slant, either way along the ray."""
        sine = np.sqrt(max(1 - self.slant**2, 0.0))
        return self.slant * np.array(self.vertical) - sine * np.array(self.along)


POINT = Footprint(0.0, 0.0)


@dataclass(frozen=True)
class Kind:
    """Rays that are marched alike.

    **Fields:**

    - `footprint`: of their pixels.
    - `knots`: points of a chord between which winds and masks are taken for linear.
    - `twice`: whether they cross the shell a second time.
    """

    footprint: Footprint
    knots: int = 2
    twice: bool = False


def kinds(
    rays: Rays, shell: Shell, ellipsoid: Ellipsoid = GRS80
) -> Int[np.ndarray, "rays 8"]:
    """The kind of each ray, as cells of the fixed grid; `kind_of` reads a row.

    **Arguments:** `shell`: the air that holds all cloud.
    """
    chord, again = chords(rays, shell, ellipsoid), second_chords(rays, shell, ellipsoid)
    middle = chord.entry_m + chord.length_m / 2
    latitude, longitude, _ = geodetic(rays.at(middle), ellipsoid)
    vertical = up(latitude, longitude)
    cell = np.round(vertical / _VERTICAL_CELL)
    slant = np.abs((vertical * rays.direction).sum(-1))
    width = rays.pixel_rad * np.maximum(middle, 1.0)
    stretch = np.minimum(1 / np.maximum(slant, 1e-9), _LONGEST)
    rung = np.round(_STRETCHES_PER_OCTAVE * np.log2(stretch))
    far = np.maximum(chord.length_m, again.length_m) * np.sqrt(1 - slant**2)
    return np.stack(
        [
            np.round(_WIDTHS_PER_OCTAVE * np.log2(width)),
            rung,
            *cell.T,
            np.where(rung > 0, _heading(rays.direction, cell), 0),
            np.where(far > _KNOT_SPACING_M, _MANY_KNOTS, 2),
            again.length_m > 0,
        ],
        axis=-1,
    ).astype(np.int64)


def kind_of(row: Int[np.ndarray, "8"]) -> Kind:
    """The kind at the middle of a cell."""
    width = 2.0 ** (row[0] / _WIDTHS_PER_OCTAVE)
    stretch = 2.0 ** (row[1] / _STRETCHES_PER_OCTAVE)
    vertical = row[2:5] / np.linalg.norm(row[2:5])
    angle = np.pi * row[5] / _DIRECTIONS
    east, north = _level_axes(vertical[None])
    along = np.cos(angle) * north[0] + np.sin(angle) * east[0]
    footprint = Footprint(
        float(width),
        float(width * stretch),
        tuple(vertical.tolist()),
        tuple(along.tolist()),
        float(1 / stretch),
    )
    return Kind(footprint, int(row[6]), bool(row[7]))


def _heading(direction, cell):
    """Which of the directions on the level surface, of which opposite ones are one."""
    east, north = _level_axes(cell / np.linalg.norm(cell, axis=-1, keepdims=True))
    angle = np.arctan2((direction * east).sum(-1), (direction * north).sum(-1))
    return np.round(angle / np.pi * _DIRECTIONS) % _DIRECTIONS


def _level_axes(vertical):
    """East and north; at a pole those of a neighbour."""
    east = np.stack(
        [-vertical[:, 1], vertical[:, 0] + 1e-9, np.zeros(len(vertical))], axis=-1
    )
    east /= np.linalg.norm(east, axis=-1, keepdims=True)
    return east, np.cross(vertical, east)
