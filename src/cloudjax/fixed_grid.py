"""The fixed grid of a geostationary imager (GOES-R PUG volume 3, section 5.1.2.8)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from .geodesy import GRS80, Ellipsoid
from .rays import Rays


@dataclass(frozen=True)
class FixedGrid:
    """Scan angles of a geostationary imager, as its files hold them.

    **Fields:**

    - `x_rad`, `y_rad`: east-west and north-south scan angles of the pixel centres.
    - `subsatellite_longitude_deg`: of the projection, not of the drifting satellite.
    - `perspective_height_m`: above the equator.
    - `sweep`: which angle the imager sweeps: "x" for GOES, "y" for Meteosat.
    """

    x_rad: Float[np.ndarray, " x"]
    y_rad: Float[np.ndarray, " y"]
    subsatellite_longitude_deg: float
    perspective_height_m: float = 35786023.0
    ellipsoid: Ellipsoid = GRS80
    sweep: Literal["x", "y"] = "x"

    @property
    def shape(self) -> tuple[int, int]:
        return len(self.y_rad), len(self.x_rad)

    @property
    def satellite_m(self) -> Float[np.ndarray, "3"]:
        """Where the satellite stands, ECEF."""
        λ = np.radians(self.subsatellite_longitude_deg)
        distance = self.ellipsoid.semi_major_m + self.perspective_height_m
        return distance * np.array([np.cos(λ), np.sin(λ), 0.0])

    def rays(self) -> Rays:
        """Lines of sight of all pixels, row by row: `rays` = y * x."""
        y, x = np.meshgrid(
            np.asarray(self.y_rad, np.float64),
            np.asarray(self.x_rad, np.float64),
            indexing="ij",
        )
        # The unit vector to the pixel in axes (to the Earth's centre, east, north).
        if self.sweep == "x":
            inward, east, north = (
                np.cos(x) * np.cos(y),
                np.sin(x),
                np.cos(x) * np.sin(y),
            )
        else:
            inward, east, north = (
                np.cos(x) * np.cos(y),
                np.sin(x) * np.cos(y),
                np.sin(y),
            )
        λ = np.radians(self.subsatellite_longitude_deg)
        direction = np.stack(
            [
                -inward * np.cos(λ) - east * np.sin(λ),
                -inward * np.sin(λ) + east * np.cos(λ),
                north,
            ],
            axis=-1,
        ).reshape(-1, 3)
        return Rays(
            np.broadcast_to(self.satellite_m, direction.shape),
            direction,
            float(abs(self.x_rad[1] - self.x_rad[0])),
        )
