"""Sections of cloud, each of which a board stands for.

Where they are follows from particles placed by what is seen of the cloud, one at least
in every cloud. Every piece of cloud belongs to the sections next to it, so that
sections share out all of the optical depth and fade into each other.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import label
from scipy.sparse import coo_array, csr_array
from scipy.spatial import KDTree

from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.geodesy import ecef, geodetic
from cloudjax.geometry.map_projections import AbstractMapProjection
from cloudjax.particles.placement import DepthColumns, place
from cloudjax_data import DataError

from .box import Box
from .seen_cloud import SeenCloud


# Optical depth of a column from which it counts as a part of a cloud.
_CLOUD_DEPTH = 0.1
# Layers in which particles are placed.
_LEVELS = 40
# Sections that share a piece, and how soon each takes over.
_SHARING = 5
_SHARPNESS = 2
# A section of few pixels is taken for level: so many pixels' worth of that.
_LEVEL = 4.0
# Planes are no steeper to the picture than this.
_STEEPEST = 3.0
# Shares less than this go to the other sections.
_LEAST_SHARE = 0.01


@dataclass(frozen=True)
class _Plane(AbstractMapProjection):
    """The ground of a box as a map, seen from straight above."""

    box: Box

    def project(self, latitude_deg, longitude_deg):
        place = self.box.local_m(ecef(latitude_deg, longitude_deg, 0 * latitude_deg))
        return place[..., 0], place[..., 1]

    def places(self, x_m, y_m):
        ground = self.box.at_altitude(np.stack([x_m, y_m], axis=-1), 0.0)
        return geodetic(self.box.ecef_m(ground))[:2]

    def heading_rad(self, latitude_deg, longitude_deg):
        del longitude_deg
        return np.zeros_like(latitude_deg)


def cloud_numbers(above: SeenCloud) -> tuple[Int[np.ndarray, " rays"], int]:
    """Number the clouds that are seen from above, from 1; 0 is clear."""
    deep = above.column_depth.reshape(above.picture.shape) >= _CLOUD_DEPTH
    found: Any = label(deep, np.ones((3, 3)))
    return found[0].reshape(-1), int(found[1])


def section_places(
    above: SeenCloud, boards: int, seed: int = 0
) -> Float[np.ndarray, "sections 3"]:
    """Choose the middles of as many sections as there are boards, in the box.

    **Arguments:** `above`: the cloud, seen from straight above.

    **Raises:** `DataError` where there is no cloud, and for fewer boards than clouds.
    """
    numbers, clouds = cloud_numbers(above)
    box = above.picture.box
    if not clouds:
        raise DataError(
            f"There is no cloud in the box of {box.size_m / 1e3:g} km about "
            f"{box.latitude_deg:g},{box.longitude_deg:g}: choose another place or time."
        )
    if boards < clouds:
        raise DataError(
            f"{boards} boards are too few for the {clouds} clouds in the box: give "
            f"--boards {clouds} or more."
        )
    deepest = _deepest(above, numbers)
    if boards == clouds:
        return above.place[deepest]
    more = scattered(above, boards - clouds, seed)
    return np.concatenate([above.place[deepest], more])


def _deepest(above: SeenCloud, numbers) -> Int[np.ndarray, " clouds"]:
    """The deepest piece of each cloud."""
    of_piece = numbers[above.ray]
    order = np.lexsort((-above.depth, of_piece))
    number, first = np.unique(of_piece[order], return_index=True)
    return order[first[number > 0]]


def scattered(
    above: SeenCloud, count: int, seed: int = 0
) -> Float[np.ndarray, "particles 3"]:
    """Place particles in a box, in proportion to what is seen of the cloud there.

    By optical depth alone the thickest clouds would have nearly all of them: what a
    column has beyond an optical depth of about 1 does not count.
    """
    picture, box = above.picture, above.picture.box
    rows, columns = picture.shape
    altitude = box.altitude_m(above.place)
    ends = np.linspace(altitude.min() - 1, altitude.max() + 1, _LEVELS + 1)
    level = np.clip(np.searchsorted(ends, altitude) - 1, 0, _LEVELS - 1)
    whole = above.column_depth
    seen = above.depth * (-np.expm1(-whole) / np.maximum(whole, 1e-9))[above.ray]
    cells = np.bincount(
        level * rows * columns + above.ray, seen, _LEVELS * rows * columns
    )
    pitch = picture.pitch_m
    first = picture.left_m + pitch / 2, picture.top_m - pitch / 2
    grid = ColumnGrid(_Plane(box), first, (pitch, -pitch), picture.shape)
    heights = np.broadcast_to(ends[:, None, None], (_LEVELS + 1, rows, columns))
    depths = DepthColumns(grid, heights, cells.reshape(_LEVELS, rows, columns))
    return box.local_m(place(depths, count, seed=seed).position_m())


@dataclass(frozen=True, eq=False)
class Sections:
    """`Sections` share out the cloud that is seen from a direction.

    Each has a plane through its cloud, so that boards stand as right as they can for
    those who do not look exactly from there: a flat cloud has a flat board.

    **Fields:**

    - `depth`: optical depth of each section on each ray; a row for each section.
    - `middle_m`: of each, along the axes of the picture: right, top, and to the viewer.
    - `slope`: how much nearer to the viewer a plane comes to the right and to the top.
    """

    depth: csr_array
    middle_m: Float[np.ndarray, "sections 3"]
    slope: Float[np.ndarray, "sections 2"]


def share_out(seen: SeenCloud, places: Float[np.ndarray, "sections 3"]) -> Sections:
    """Share out cloud among the sections about places, those with none left out."""
    piece, section, share = _shares(seen.place, places)
    depth = share * seen.depth[piece]
    shape = len(places), len(seen.opacity)
    found = coo_array((depth, (section, seen.ray[piece])), shape=shape).tocsr()
    some = np.flatnonzero(np.diff(found.indptr))
    # What counts is what is seen of a section, and not its darkest part.
    weight = -np.expm1(-depth)
    across = (seen.place @ seen.picture.sector.axes.T)[piece]
    middle, slope = _planes(seen, section, weight, across, len(places))
    return Sections(found[some], middle[some], slope[some])


def _planes(seen: SeenCloud, section, weight, across, count: int):
    """Middles of sections, and slopes of planes by least squares."""

    def mean(values):
        total = np.bincount(section, weight, count)
        return np.bincount(section, weight * values, count) / np.maximum(total, 1e-30)

    middle = np.stack([mean(x) for x in across.T], axis=-1)
    u, v, w = (across - middle[section]).T
    pitch, (_, top, towards) = seen.picture.pitch_m, seen.picture.sector.axes
    level = np.array([0.0, -top[2] / max(towards[2], 1 / _STEEPEST)])
    few = _LEVEL * pitch**2
    square = np.stack(
        [mean(u * u) + few, mean(u * v), mean(u * v), mean(v * v) + few], -1
    ).reshape(count, 2, 2)
    product = np.stack([mean(u * w), mean(v * w)], axis=-1) + few * level
    slope = np.linalg.solve(square, product[..., None])[..., 0]
    size = np.linalg.norm(slope, axis=-1, keepdims=True)
    return middle, slope * np.minimum(1, _STEEPEST / np.maximum(size, 1e-9))


def _shares(
    place: Float[np.ndarray, "pieces 3"], places: Float[np.ndarray, "sections 3"]
):
    """Pieces, sections that hold a part of them, and these parts (after Shepard).

    A part vanishes where the section is no longer among the nearest.
    """
    near = min(_SHARING + 1, len(places))
    distance, section = KDTree(places).query(place, near)
    distance, section = (x.reshape(len(place), near) for x in (distance, section))
    if near > 1:
        farthest = distance[:, -1:]
        part = (farthest - distance) / np.maximum(distance, 1e-3 * farthest + 1e-3)
        part = part**_SHARPNESS
        # All as far away as each other: the first has it.
        part[part.sum(-1) == 0, 0] = 1
    else:
        part = np.ones_like(distance)
    part /= part.sum(-1, keepdims=True)
    part[part < _LEAST_SHARE] = 0
    part /= part.sum(-1, keepdims=True)
    piece, which = np.nonzero(part)
    return piece, section[piece, which], part[piece, which]
