"""A perspective camera stands in orbit, in an aircraft, on the ground or in a cloud."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from .geodesy import GRS80, Ellipsoid, east_north_up, ecef
from .rays import Rays


@dataclass(frozen=True)
class Camera:
    """A `Camera` is a pinhole camera with square pixels.

    **Fields:**

    - `latitude_deg`, `longitude_deg`, `altitude_m`: where it is (geodetic).
    - `azimuth_deg`, `elevation_deg`: of the optical axis, clockwise from north and up
      from the horizontal: -90 looks straight down, +90 straight up. The top of the
      image is towards higher elevation. Looking straight down it is towards the
      azimuth, straight up away from it.
    - `roll_deg`: clockwise turn of the camera about its axis, as seen from behind it.
    - `field_of_view_deg`: between the outer edges of the first and last column.
    - `rows`, `columns`: numbers of pixels.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    azimuth_deg: float
    elevation_deg: float
    field_of_view_deg: float
    rows: int
    columns: int
    roll_deg: float = 0.0
    ellipsoid: Ellipsoid = GRS80

    def __post_init__(self):
        numbers = (
            ("latitude_deg", -90, 90),
            ("longitude_deg", -360, 360),
            ("altitude_m", -500, 1e9),
            ("azimuth_deg", -360, 360),
            ("elevation_deg", -90, 90),
            ("roll_deg", -360, 360),
        )
        for name, low, high in numbers:
            # Written so that NaN fails.
            if not low <= getattr(self, name) <= high:
                raise ValueError(
                    f"{name} of a camera must lie within {low:g} and {high:g}; it is "
                    f"{getattr(self, name)}."
                )
        if not 0 < self.field_of_view_deg < 180:
            raise ValueError(
                "field_of_view_deg of a camera must lie between 0 and 180; it is "
                f"{self.field_of_view_deg}."
            )
        if self.rows < 1 or self.columns < 1:
            raise ValueError(
                f"A camera of {self.rows} rows and {self.columns} columns sees "
                "nothing: give at least one of each."
            )

    @staticmethod
    def looking_at(
        latitude_deg: float,
        longitude_deg: float,
        altitude_m: float,
        *,
        target_latitude_deg: float,
        target_longitude_deg: float,
        target_altitude_m: float = 0.0,
        field_of_view_deg: float,
        rows: int,
        columns: int,
        roll_deg: float = 0.0,
        ellipsoid: Ellipsoid = GRS80,
    ) -> "Camera":
        """Make the camera whose axis passes through a target, given as a geodetic
        position.

        With the target straight below or above, the azimuth is 0.
        """
        here = _place(latitude_deg, longitude_deg, altitude_m, ellipsoid)
        line = -here + _place(
            target_latitude_deg, target_longitude_deg, target_altitude_m, ellipsoid
        )
        east, north, vertical = east_north_up(latitude_deg, longitude_deg) @ line
        distance, across = np.linalg.norm(line), np.hypot(east, north)
        if distance == 0:
            raise ValueError("A camera cannot look at its own place: move the target.")
        # Less than rounding has no direction.
        straight = across < 1e-10 * np.linalg.norm(here)
        return Camera(
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            altitude_m=altitude_m,
            azimuth_deg=0.0 if straight else float(np.degrees(np.arctan2(east, north))),
            elevation_deg=float(np.degrees(np.arctan2(vertical, across))),
            field_of_view_deg=field_of_view_deg,
            rows=rows,
            columns=columns,
            roll_deg=roll_deg,
            ellipsoid=ellipsoid,
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Count the rows and columns."""
        return self.rows, self.columns

    @property
    def position_m(self) -> Float[np.ndarray, "3"]:
        """Give the place of the camera [m], ECEF."""
        return _place(
            self.latitude_deg, self.longitude_deg, self.altitude_m, self.ellipsoid
        )

    @property
    def axes(self) -> Float[np.ndarray, "3 3"]:
        """Give the ECEF unit vectors along the optical axis, to the right and to the
        top.
        """
        α, ε, ρ = np.radians([self.azimuth_deg, self.elevation_deg, self.roll_deg])
        ahead = np.array([np.sin(α), np.cos(α), 0.0])
        zenith = np.array([0.0, 0.0, 1.0])
        axis = np.cos(ε) * ahead + np.sin(ε) * zenith
        right = np.array([np.cos(α), -np.sin(α), 0.0])
        top = np.cos(ε) * zenith - np.sin(ε) * ahead
        rolled = (
            axis,
            np.cos(ρ) * right - np.sin(ρ) * top,
            np.cos(ρ) * top + np.sin(ρ) * right,
        )
        return np.stack(rolled) @ east_north_up(self.latitude_deg, self.longitude_deg)

    def rays(self, pixels: Int[np.ndarray, " rays"] | None = None) -> Rays:
        """Return the lines of sight of the pixels with these flat indices, or of all.

        Flat indices count row by row from the top left: `rays` = rows * columns. The
        angle of a pixel is that of one on the optical axis; towards the corners of a
        wide image pixels are narrower.
        """
        if pixels is None:
            pixels = np.arange(self.rows * self.columns)
        row, column = np.divmod(pixels, self.columns)
        pitch = 2 * np.tan(np.radians(self.field_of_view_deg) / 2) / self.columns
        x = (column - (self.columns - 1) / 2) * pitch
        y = ((self.rows - 1) / 2 - row) * pitch
        direction = np.stack([np.ones_like(x), x, y], axis=-1) @ self.axes
        direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
        return Rays(
            np.broadcast_to(self.position_m, direction.shape),
            direction,
            float(2 * np.arctan(pitch / 2)),
        )


def _place(latitude_deg, longitude_deg, altitude_m, ellipsoid):
    φ, λ, z = np.array([[latitude_deg], [longitude_deg], [altitude_m]], np.float64)
    return ecef(φ, λ, z, ellipsoid)[0]
