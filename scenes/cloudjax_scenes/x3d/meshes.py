"""Boards as triangles: one mesh for all boards of a tile that a sector shows."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from .atlas import Atlas
from .boards import Boards
from .box import Box


@dataclass(frozen=True, eq=False)
class Mesh:
    """A `Mesh` has triangles with a texture, in the order in which they are drawn.

    **Fields:**

    - `place_m`: of the corners, east, north and up of the box's centre.
    - `texture`: where they are in the texture, from its lower left, 0 to 1.
    - `corners`: of the triangles.
    """

    place_m: Float[np.ndarray, "corners 3"]
    texture: Float[np.ndarray, "corners 2"]
    corners: Int[np.ndarray, "triangles 3"]


@dataclass(frozen=True)
class Tiles:
    """`Tiles` cut a box into squares whose boards turn to the viewer together.

    **Fields:** `box`; `count`: along each edge.
    """

    box: Box
    count: int

    def numbers(self, place_m: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, " n"]:
        """Return the tile of each place, counted from the south west, row by row."""
        part = (place_m[:, :2] / self.box.size_m + 0.5) * self.count
        column, row = np.clip(np.floor(part), 0, self.count - 1).astype(int).T
        return row * self.count + column

    def middle_m(self, number: int) -> tuple[float, float]:
        """Return where the middle of a tile is, to the east and to the north."""
        row, column = divmod(number, self.count)
        east, north = (
            ((i + 0.5) / self.count - 0.5) * self.box.size_m for i in (column, row)
        )
        return float(east), float(north)


def board_meshes(
    boards: Boards, atlas: Atlas, tiles: Tiles
) -> Iterator[tuple[int, Mesh]]:
    """Give the tiles that have boards, each with its boards from back to front."""
    if not boards.boards:
        return
    quads, inside = _quads(boards), atlas.inside(boards)
    middles = np.array([board.middle_m for board in boards.boards])
    numbers = tiles.numbers(middles @ boards.picture.sector.axes)
    for number in np.unique(numbers):
        own = numbers == number
        left, bottom, right, top = inside[own].T
        texture = np.stack([left, bottom, right, bottom, right, top, left, top], -1)
        first = 4 * np.arange(own.sum())[:, None, None]
        corners = first + np.array([[0, 1, 2], [0, 2, 3]])
        yield (
            int(number),
            Mesh(
                quads[own].reshape(-1, 3),
                texture.reshape(-1, 2),
                corners.reshape(-1, 3),
            ),
        )


def _quads(boards: Boards) -> Float[np.ndarray, "boards 4 3"]:
    """Corners of the boards, from the lower left against the clock.

    They lie on the lines of sight through the corners in the picture, in the plane of
    the section.
    """
    picture, every = boards.picture, boards.boards
    rows = np.array([(b.rows.start, b.rows.stop) for b in every], float)
    columns = np.array([(b.columns.start, b.columns.stop) for b in every], float)
    left, right = (picture.left_m + columns * picture.pitch_m).T
    top, bottom = (picture.top_m - rows * picture.pitch_m).T
    u = np.stack([left, right, right, left], axis=-1)
    v = np.stack([bottom, bottom, top, top], axis=-1)
    middle = np.array([b.middle_m for b in every])[:, :, None]
    slope = np.array([b.slope for b in every])[:, :, None]
    near = (
        middle[:, 2]
        + slope[:, 0] * (u - middle[:, 0])
        + slope[:, 1] * (v - middle[:, 1])
    )
    return np.stack([u, v, near], axis=-1) @ picture.sector.axes


def ground_mesh(box: Box, squares: int = 16) -> Mesh:
    """Return the ground of a box, as round as the Earth, with its texture on it."""
    part = np.linspace(0, 1, squares + 1)
    texture = np.stack(np.meshgrid(part, part), axis=-1).reshape(-1, 2)
    place = box.at_altitude((texture - 0.5) * box.size_m, 0.0)
    first = (np.arange(squares)[:, None] * (squares + 1) + np.arange(squares)).reshape(
        -1
    )
    next_row = squares + 1
    corners = first[:, None] + np.array([0, 1, next_row + 1, 0, next_row + 1, next_row])
    return Mesh(place, texture, corners.reshape(-1, 3))
