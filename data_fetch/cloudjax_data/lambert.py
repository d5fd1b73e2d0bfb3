"""Regional weather models use the Lambert conformal conic map."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64


@dataclass(frozen=True)
class LambertConic:
    """A `LambertConic` maps the sphere, in units of the radius divided by a constant.

    **Fields:**

    - `longitude_deg`: the meridian that points straight up (`LoV` in GRIB).
    - `latitude_1_deg`, `latitude_2_deg`: where the cone cuts the sphere; equal where it
        touches.
    """

    longitude_deg: float
    latitude_1_deg: float
    latitude_2_deg: float

    @property
    def cone(self) -> float:
        """Give the turn of the map per turn of longitude (Snyder 1987, eq. 15-3)."""
        one, two = np.radians([self.latitude_1_deg, self.latitude_2_deg])
        if np.isclose(one, two):
            return float(np.sin(one))
        spread = np.log(np.tan(np.pi / 4 + two / 2) / np.tan(np.pi / 4 + one / 2))
        return float(np.log(np.cos(one) / np.cos(two)) / spread)

    @property
    def scale(self) -> float:
        """Give the length of the map's unit, in radii of the sphere (Snyder, 15-2)."""
        one = np.radians(self.latitude_1_deg)
        return float(np.cos(one) * np.tan(np.pi / 4 + one / 2) ** self.cone)

    def rotation_rad(
        self, longitude_deg: Float64[np.ndarray, "*points"]
    ) -> Float64[np.ndarray, "*points"]:
        """Return the angle from true north to the y axis of the map, clockwise
        positive.
        """
        # East of the central meridian, meridians lean left: up is east of north.
        return self.cone * np.radians(self._from_centre(longitude_deg))

    def project(
        self,
        latitude_deg: Float64[np.ndarray, "*points"],
        longitude_deg: Float64[np.ndarray, "*points"],
    ) -> tuple[Float64[np.ndarray, "*points"], Float64[np.ndarray, "*points"]]:
        """Return map coordinates x and y (Snyder 1987, eqs 15-1 and 14-4)."""
        polar = np.pi / 4 + np.radians(latitude_deg) / 2
        radius = np.tan(polar) ** -self.cone / self.cone
        angle = self.rotation_rad(longitude_deg)
        return radius * np.sin(angle), -radius * np.cos(angle)

    def unproject(
        self, x: Float64[np.ndarray, "*points"], y: Float64[np.ndarray, "*points"]
    ) -> tuple[Float64[np.ndarray, "*points"], Float64[np.ndarray, "*points"]]:
        """Return latitude and longitude [degrees] (Snyder 1987, eqs 14-9 and 15-5),
        the longitude within 180° of the central meridian.
        """
        cone = self.cone
        side = np.sign(cone)
        radius = np.abs(cone) * np.hypot(x, y)
        # The pole that the cone points to is at the centre.
        tangent = np.maximum(radius, np.finfo(float).tiny) ** (-1 / cone)
        angle = np.degrees(np.arctan2(side * x, -side * y)) / cone
        return 2 * np.degrees(np.arctan(tangent)) - 90, self.longitude_deg + angle

    def _from_centre(self, longitude_deg: np.ndarray) -> np.ndarray:
        return (longitude_deg - self.longitude_deg + 180) % 360 - 180
