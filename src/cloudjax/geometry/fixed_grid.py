"""Geostationary imagers have a fixed grid (GOES-R PUG volume 3, section 5.1.2.8)."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy.typing import ArrayLike

from .arrays import HostArray, namespace
from .geodesy import GRS80, Ellipsoid, dot, ecef, up
from .rays import Rays


# PUG volume 3, section 5.1.2: pixels of the full disc by resolution in kilometres; a
# kilometre is 28 microradians. 10 km pixels do not divide the 2 km disc: its files have
# one more on each side than fit.
FULL_DISC_PIXELS = {0.5: 21696, 1.0: 10848, 2.0: 5424, 4.0: 2712, 10.0: 1086}
RAD_PER_KM = 28e-6
# The regional sectors by their widths and centres, east and north.
CONUS_RAD = (0.14, 0.084)
CONUS_CENTRE_RAD = (-0.03136, 0.08624)
PACUS_CENTRE_RAD = (0.0, 0.08624)
MESO_RAD = (0.028, 0.028)
# On multiples of 20 km from nadir the pixels of every resolution are those of the full
# disc. The centres of the sectors that NOAA files hold are such multiples.
MESO_LATTICE_RAD = 20 * RAD_PER_KM
GOES_EAST_DEG = -75.0
# A quarter of a percent of the finest ABI pixel (14 microradians), and ten times what
# rounding scale and offset to six decimals can move a centre by.
SAME_CENTRE_RAD = 1e-7


@dataclass(frozen=True, eq=False)
class FixedGrid:
    """A `FixedGrid` holds the scan angles of a geostationary imager, as its files do.

    **Fields:**

    - `x_rad`, `y_rad`: scan angles of the pixel centres, evenly spaced; x grows
        eastward, and in files y falls from the first row, the northernmost.
    - `subsatellite_longitude_deg`: the longitude of the projection, east positive; the
        satellite itself may drift some tenths of a degree about it.
    - `perspective_height_m`: of the projection point above the equator.
    - `ellipsoid`: the Earth's.
    - `sweep`: which angle the imager sweeps: "x" for GOES, "y" for Meteosat.
    """

    x_rad: Float[np.ndarray, " x"]
    y_rad: Float[np.ndarray, " y"]
    subsatellite_longitude_deg: float
    perspective_height_m: float = 35786023.0
    ellipsoid: Ellipsoid = GRS80
    sweep: Literal["x", "y"] = "x"

    @staticmethod
    def abi_full_disc(
        resolution_km: float, subsatellite_longitude_deg: float = GOES_EAST_DEG
    ) -> "FixedGrid":
        """Make the full disc of ABI.

        **Arguments:** `resolution_km`: 0.5, 1, 2, 4 or 10.
        """
        step = _step_rad(resolution_km)
        width = FULL_DISC_PIXELS[resolution_km] * step
        return _sector((width, width), (0.0, 0.0), step, subsatellite_longitude_deg)

    @staticmethod
    def abi_conus(
        resolution_km: float, subsatellite_longitude_deg: float = GOES_EAST_DEG
    ) -> "FixedGrid":
        """Make the regional sector of ABI: CONUS from within a degree of 75 W, else
        PACUS.

        From elsewhere than 137 W it shows the part of the disc that PACUS would, east
        and west of the sub-satellite meridian alike.
        """
        from_east = abs(subsatellite_longitude_deg - GOES_EAST_DEG) <= 1
        return _sector(
            CONUS_RAD,
            CONUS_CENTRE_RAD if from_east else PACUS_CENTRE_RAD,
            _step_rad(resolution_km),
            subsatellite_longitude_deg,
        )

    @staticmethod
    def abi_meso(
        resolution_km: float,
        latitude_deg: float,
        longitude_deg: float,
        subsatellite_longitude_deg: float = GOES_EAST_DEG,
    ) -> "FixedGrid":
        """Make a mesoscale sector of ABI, centred within 10 km (at nadir) of a place.

        Its pixels are those of the full disc.

        **Raises:** `ValueError` where the satellite does not see the place.
        """
        step = _step_rad(resolution_km)
        disc = FixedGrid.abi_full_disc(resolution_km, subsatellite_longitude_deg)
        centre = [
            round(angle / MESO_LATTICE_RAD) * MESO_LATTICE_RAD
            for angle in disc.scan_angles_rad(latitude_deg, longitude_deg)
        ]
        return _sector(MESO_RAD, centre, step, subsatellite_longitude_deg)

    def __eq__(self, other) -> bool:
        """Tell whether all numbers of two grids are equal, to the last digit."""
        return isinstance(other, FixedGrid) and self._numbers == other._numbers

    def __hash__(self) -> int:
        return hash(self._numbers)

    @property
    def _numbers(self) -> tuple:
        x_rad, y_rad = (np.asarray(a, np.float64) for a in (self.x_rad, self.y_rad))
        return (
            x_rad.tobytes(),
            y_rad.tobytes(),
            self.subsatellite_longitude_deg,
            self.perspective_height_m,
            self.ellipsoid,
            self.sweep,
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Count the rows and columns."""
        return len(self.y_rad), len(self.x_rad)

    @property
    def step_rad(self) -> float:
        """Give the distance between neighbouring columns or, of a single one, rows."""
        angles = self.x_rad if len(self.x_rad) > 1 else self.y_rad
        span = abs(float(angles[-1]) - float(angles[0]))
        return span / max(len(angles) - 1, 1)

    def same_projection_as(self, other: "FixedGrid") -> bool:
        """Whether equal scan angles of both grids are the same lines of sight."""
        return (
            self.subsatellite_longitude_deg == other.subsatellite_longitude_deg
            and self.perspective_height_m == other.perspective_height_m
            and self.ellipsoid == other.ellipsoid
            and self.sweep == other.sweep
        )

    def same_as(self, other: "FixedGrid") -> bool:
        """Whether both grids have the same pixels, within `SAME_CENTRE_RAD`."""
        return (
            self.shape == other.shape
            and self.same_projection_as(other)
            and _close(self.x_rad, other.x_rad)
            and _close(self.y_rad, other.y_rad)
        )

    def coarsened(self, factor: int) -> "FixedGrid":
        """Return the grid of blocks of `factor` by `factor` pixels.

        **Raises:** `ValueError` when the blocks do not fill the grid.
        """
        return replace(
            self,
            x_rad=_block_centres(self.x_rad, factor),
            y_rad=_block_centres(self.y_rad, factor),
        )

    @property
    def satellite_m(self) -> Float[np.ndarray, "3"]:
        """Give the place of the satellite [m], ECEF."""
        distance = self.ellipsoid.semi_major_m + self.perspective_height_m
        return -distance * self._axes[0]

    @property
    def _axes(self) -> Float[np.ndarray, "3 3"]:
        """Unit vectors from the satellite to the Earth's centre, east and north."""
        λ = np.radians(self.subsatellite_longitude_deg)
        return np.array(
            [[-np.cos(λ), -np.sin(λ), 0], [-np.sin(λ), np.cos(λ), 0], [0, 0, 1]]
        )

    def scan_angles_rad(
        self, latitude_deg: float, longitude_deg: float
    ) -> tuple[float, float]:
        """Return the scan angles x and y [radians] of a place on the ground.

        **Raises:** `ValueError` where the satellite does not see it.
        """
        x, y = self.angles_of(np.array([latitude_deg]), np.array([longitude_deg]))
        if np.isinf(x[0]):
            raise ValueError(
                f"Latitude {latitude_deg} longitude {longitude_deg} cannot be seen "
                f"from above longitude {self.subsatellite_longitude_deg}."
            )
        return float(x[0]), float(y[0])

    def angles_of(
        self,
        latitude_deg: Float[HostArray, "*n"],
        longitude_deg: Float[HostArray, "*n"],
    ) -> tuple[Float[HostArray, "*n"], Float[HostArray, "*n"]]:
        """Return the scan angles x and y [radians] of places on the ground, infinite
        where the satellite does not see them.
        """
        line = self._line_m(latitude_deg, longitude_deg)
        hidden = dot(line, up(latitude_deg, longitude_deg)) >= 0
        x, y = self._angles_rad(line)
        xp = namespace(line)
        return xp.where(hidden, np.inf, x), xp.where(hidden, np.inf, y)

    def directions(
        self, x_rad: Float[np.ndarray, "*n"], y_rad: Float[np.ndarray, "*n"]
    ) -> Float[np.ndarray, "*n 3"]:
        """Return unit vectors away from the satellite, ECEF, at scan angles."""
        x, y = x_rad, y_rad
        # In axes to the Earth's centre, east and north.
        if self.sweep == "x":
            local = [np.cos(x) * np.cos(y), np.sin(x), np.cos(x) * np.sin(y)]
        else:
            local = [np.cos(x) * np.cos(y), np.sin(x) * np.cos(y), np.sin(y)]
        return np.stack(local, axis=-1) @ self._axes

    def _line_m(self, latitude_deg, longitude_deg) -> Float[HostArray, "*n 3"]:
        """From the satellite to places on the ground."""
        sea_level = np.zeros(np.shape(latitude_deg))
        place = ecef(latitude_deg, longitude_deg, sea_level, self.ellipsoid)
        satellite = self.satellite_m.reshape((1,) * (place.ndim - 1) + (3,))
        return place - satellite

    def _angles_rad(self, line_m) -> tuple[HostArray, HostArray]:
        xp = namespace(line_m)
        local = xp.moveaxis(line_m @ self._axes.T, -1, 0)
        inward, east, north = local / xp.sqrt(dot(line_m, line_m))[None]
        if self.sweep == "x":
            return xp.arcsin(east), xp.arctan2(north, inward)
        return xp.arctan2(east, inward), xp.arcsin(north)

    def sample(
        self,
        nodes: ArrayLike,
        latitude_deg: Float[np.ndarray, " points"],
        longitude_deg: Float[np.ndarray, " points"],
    ) -> Float[np.ndarray, "points channels"]:
        """Interpolate an image bilinearly between the centres of its pixels, at places
        on the ground; outside of the image it is held constant.

        Places that the satellite does not see get those before them.

        **Arguments:** `nodes`: [y x channels].
        """
        # Readers of files need not wait for scipy.
        from scipy.ndimage import map_coordinates

        x, y = self._angles_rad(self._line_m(latitude_deg, longitude_deg))
        position = _index(self.y_rad, y), _index(self.x_rad, x)
        channels = np.moveaxis(np.asarray(nodes), -1, 0)
        found = [
            map_coordinates(channel, position, order=1, mode="nearest")
            for channel in channels
        ]
        return np.stack(found, axis=-1)

    def sees_the_earth(self) -> Bool[np.ndarray, "y x"]:
        """Tell which pixels see the ellipsoid, much faster than `rays().ground()`.

        A line of sight meets it where the discriminant of its quadratic is not
        negative. The disc is convex: four corners that see it have nothing else
        between.
        """
        corners = self._meets(self.y_rad[[0, -1]], self.x_rad[[0, -1]])
        if corners.all():
            return np.ones(self.shape, bool)
        return self._meets(self.y_rad, self.x_rad)

    def _meets(self, y_rad, x_rad) -> Bool[np.ndarray, "y x"]:
        a, b = self.ellipsoid.semi_major_m, self.ellipsoid.semi_minor_m
        distance = a + self.perspective_height_m
        inward = np.cos(y_rad)[:, None] * np.cos(x_rad)
        north = np.sin(y_rad)[:, None] * (np.cos(x_rad) if self.sweep == "x" else 1.0)
        along = (1 - north**2) / a**2 + north**2 / b**2
        return distance**2 * inward**2 / a**4 >= along * (distance**2 / a**2 - 1)

    def rays(self, pixels: Int[np.ndarray, " rays"] | None = None) -> Rays:
        """Return the lines of sight of the pixels with these flat indices, or of all.

        Flat indices count row by row: `rays` = y * x.
        """
        if pixels is None:
            pixels = np.arange(len(self.y_rad) * len(self.x_rad))
        row, column = np.divmod(pixels, len(self.x_rad))
        x = np.asarray(self.x_rad, np.float64)[column]
        y = np.asarray(self.y_rad, np.float64)[row]
        direction = self.directions(x, y)
        return Rays(
            np.broadcast_to(self.satellite_m, direction.shape),
            direction,
            self.step_rad,
        )


def _index(centres_rad: np.ndarray, angles_rad: np.ndarray) -> np.ndarray:
    """Positions among pixels, 0 at the centre of the first."""
    last = len(centres_rad) - 1
    if last == 0:
        return np.zeros_like(angles_rad)
    return (angles_rad - centres_rad[0]) / (centres_rad[-1] - centres_rad[0]) * last


def _block_centres(angles: np.ndarray, factor: int) -> np.ndarray:
    if angles.size % factor:
        raise ValueError(
            f"{angles.size} pixels cannot be cut into blocks of {factor}: "
            "choose a divisor."
        )
    return angles.reshape(-1, factor).mean(axis=1)


def _close(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.all(np.abs(a - b) < SAME_CENTRE_RAD))


def _step_rad(resolution_km: float) -> float:
    if resolution_km not in FULL_DISC_PIXELS:
        known = ", ".join(f"{km:g}" for km in FULL_DISC_PIXELS)
        raise ValueError(
            f"ABI has no grid of {resolution_km:g} km: its resolutions are {known} km."
        )
    return resolution_km * RAD_PER_KM


def _sector(width_rad, centre_rad, step_rad: float, longitude_deg: float) -> FixedGrid:
    columns, rows = (round(width / step_rad) for width in width_rad)
    x, y = (
        centre + step_rad * (np.arange(count) - (count - 1) / 2)
        for centre, count in zip(centre_rad, (columns, rows), strict=True)
    )
    return FixedGrid(x, y[::-1].copy(), float(longitude_deg))
