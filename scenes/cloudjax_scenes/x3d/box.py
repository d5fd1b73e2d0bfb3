"""A box of air over a place, and the directions from which it is looked at."""

import functools as ft
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from cloudjax import Rays
from cloudjax.geometry.geodesy import east_north_up, ecef, geodetic
from cloudjax_data import DataError


# From there rays come to the box, so that all pixels are as good as equally wide.
_AFAR_M = 1000e3
# Beyond it, directions of view differ too much over the box.
LARGEST_KM = 2000.0

Points = Float[np.ndarray, "*points 3"]


@dataclass(frozen=True)
class Box:
    """A `Box` has a square of ground, and the air straight above it.

    Places within are metres to the east, to the north and upwards of its centre; up is
    that of the centre everywhere, so that the ground falls off towards the edges.

    **Fields:**

    - `latitude_deg`, `longitude_deg`: of the centre.
    - `size_m`: from edge to edge.

    **Raises:** `DataError` for a place or a size that is none.
    """

    latitude_deg: float
    longitude_deg: float
    size_m: float

    def __post_init__(self):
        # Written so that NaN fails.
        if not (abs(self.latitude_deg) <= 90 and abs(self.longitude_deg) <= 360):
            raise DataError(
                f"The centre {self.latitude_deg:g},{self.longitude_deg:g} is no place: "
                "give a latitude within 90 and a longitude within 360 degrees."
            )
        if not 0.1e3 <= self.size_m <= LARGEST_KM * 1e3:
            raise DataError(
                f"A box of {self.size_m / 1e3:g} km is none: make it 0.1 to "
                f"{LARGEST_KM:g} km."
            )

    @ft.cached_property
    def axes(self) -> Float[np.ndarray, "3 3"]:
        """Give the unit vectors to the east, to the north and upwards, ECEF."""
        return np.asarray(east_north_up(self.latitude_deg, self.longitude_deg))

    @ft.cached_property
    def origin_m(self) -> Float[np.ndarray, "3"]:
        """Give the centre on the ground, ECEF."""
        place = np.array([self.latitude_deg]), np.array([self.longitude_deg])
        return ecef(*place, np.zeros(1))[0]

    def ecef_m(self, place: Points) -> Points:
        """Return places of the box in ECEF."""
        return self.origin_m + place @ self.axes

    def local_m(self, position_m: Points) -> Points:
        """Return ECEF positions as places of the box."""
        return (position_m - self.origin_m) @ self.axes.T

    def altitude_m(self, place: Points) -> Float[np.ndarray, "*points"]:
        """Return geodetic altitudes of places."""
        return geodetic(self.ecef_m(place))[2]

    def at_altitude(
        self,
        level: Float[np.ndarray, "*points 2"],
        altitude_m: Float[np.ndarray, "*#points"] | float,
    ) -> Points:
        """Return places to the east and north of the centre, at geodetic altitudes."""
        place = np.concatenate([level, np.zeros((*level.shape[:-1], 1))], axis=-1)
        for _ in range(3):
            place[..., 2] += altitude_m - self.altitude_m(place)
        return place

    def holds(self, place: Points) -> Bool[np.ndarray, "*points"]:
        """Tell which places are over its square."""
        return np.asarray((np.abs(place[..., :2]) <= self.size_m / 2).all(-1))


@dataclass(frozen=True)
class Sector:
    """A `Sector` holds the directions of view for which one set of boards is made.

    **Fields:**

    - `name`: such as "up", of its textures.
    - `azimuth_deg`, `elevation_deg`: of the viewer from the box; the boards face there.
    """

    name: str
    azimuth_deg: float
    elevation_deg: float

    @property
    def axes(self) -> Float[np.ndarray, "3 3"]:
        """The unit vectors to the right and to the top of the picture and to the
        viewer, as east, north and up.
        """
        α, ε = np.radians([self.azimuth_deg, self.elevation_deg])
        towards = np.array([np.sin(α) * np.cos(ε), np.cos(α) * np.cos(ε), np.sin(ε)])
        right = np.array([-np.cos(α), np.sin(α), 0.0])
        return np.stack([right, np.cross(towards, right), towards])


UP = Sector("up", 180.0, 90.0)
# A viewer lower than this sees the boards of the nearest azimuth.
STEEP_DEG = 50.0


def sectors(azimuths: int, elevation_deg: float = 20.0) -> tuple[Sector, ...]:
    """Return the sector from above, then those of azimuths clockwise from north."""
    around = (360.0 * i / azimuths for i in range(azimuths))
    return (UP, *(Sector(f"az{round(a):03d}", a, elevation_deg) for a in around))


@dataclass(frozen=True, eq=False)
class Picture:
    """A `Picture` is a raster across the direction of a sector: parallel rays.

    **Fields:**

    - `box`, `sector`: of what, and from where.
    - `left_m`, `top_m`: of its edges, along the sector's axes.
    - `pitch_m`: of its pixels.
    - `shape`: rows, from the top, and columns.
    """

    box: Box
    sector: Sector
    left_m: float
    top_m: float
    pitch_m: float
    shape: tuple[int, int]

    @classmethod
    def of(
        cls, box: Box, sector: Sector, pitch_m: float, heights_m: tuple[float, float]
    ) -> "Picture":
        """Frame all air of a box between two altitudes.

        Rows and columns are multiples of 8, so that coarser pictures fit in.
        """
        side = np.linspace(-0.5, 0.5, 9) * box.size_m
        level = np.stack(np.meshgrid(side, side), axis=-1)
        around = np.stack([box.at_altitude(level, z) for z in heights_m])
        across = around @ sector.axes[:2].T
        low, high = across.min((0, 1, 2)), across.max((0, 1, 2))
        count = np.ceil((high - low) / pitch_m / 8 - 1e-9).astype(int) * 8
        left, top = (low + high) / 2 + count * pitch_m / 2 * [-1, 1]
        shape = int(count[1]), int(count[0])
        return cls(box, sector, float(left), float(top), pitch_m, shape)

    def rays(self, index: Int[np.ndarray, " rays"]) -> Rays:
        """Return the lines of sight of pixels, counted row by row."""
        row, column = np.divmod(index, self.shape[1])
        across = np.stack(
            [
                self.left_m + (column + 0.5) * self.pitch_m,
                self.top_m - (row + 0.5) * self.pitch_m,
                np.full(len(index), _AFAR_M),
            ],
            axis=-1,
        )
        start = self.box.ecef_m(across @ self.sector.axes)
        ahead = -self.sector.axes[2] @ self.box.axes
        direction = np.broadcast_to(ahead, start.shape)
        return Rays(start, direction, self.pitch_m / _AFAR_M)
