"""Weather models compute on maps of a sphere; here latitudes and longitudes become map
coordinates and back, in float64 on the host.

Latitudes of the model's sphere are taken for geodetic ones, as its makers do.
"""

import abc
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from .arrays import HostArray, namespace


# The sphere of WRF (share/module_model_constants.F).
MODEL_RADIUS_M = 6_370_000.0

Numbers = Float[HostArray, "*n"]


@dataclass(frozen=True)
class AbstractMapProjection(abc.ABC):
    """A map projection gives every place of the sphere two coordinates in metres."""

    @abc.abstractmethod
    def project(
        self, latitude_deg: Numbers, longitude_deg: Numbers
    ) -> tuple[Numbers, Numbers]:
        """Return map coordinates x and y [m]."""

    @abc.abstractmethod
    def places(self, x_m: Numbers, y_m: Numbers) -> tuple[Numbers, Numbers]:
        """Return latitude and longitude [degrees], the inverse of `project`."""

    @abc.abstractmethod
    def heading_rad(self, latitude_deg: Numbers, longitude_deg: Numbers) -> Numbers:
        """Return the angle from true north to the map's y axis, clockwise positive."""

    def to_east_and_north(
        self,
        latitude_deg: Numbers,
        longitude_deg: Numbers,
        along_x: Float[np.ndarray, "*#more"],
        along_y: Float[np.ndarray, "*#more"],
    ) -> tuple[Float[np.ndarray, "*more"], Float[np.ndarray, "*more"]]:
        """Turn vectors from the axes of the map to true east and north."""
        angle = self.heading_rad(latitude_deg, longitude_deg)
        cos, sin = np.cos(angle), np.sin(angle)
        return along_y * sin + along_x * cos, along_y * cos - along_x * sin


@dataclass(frozen=True)
class ConformalConic(AbstractMapProjection):
    """A `ConformalConic` is a Lambert map; with a cone of ±1 a polar stereographic one.

    **Fields:**

    - `cone`: turn of the map per turn of longitude, negative on southern maps.
    - `longitude_deg`: the meridian that points straight up.
    - `true_latitude_deg`: where lengths are true.
    """

    cone: float
    longitude_deg: float
    true_latitude_deg: float

    @staticmethod
    def lambert(one_deg: float, two_deg: float, longitude_deg: float):
        """Make a Lambert map that is true at two latitudes (Snyder 1987, eq. 15-3)."""
        one, two = np.radians([one_deg, two_deg])
        cone = np.sin(one)
        if abs(one - two) > 1e-9:
            spread = np.log(_polar_tangent(two_deg) / _polar_tangent(one_deg))
            cone = np.log(np.cos(one) / np.cos(two)) / spread
        return ConformalConic(float(cone), longitude_deg, one_deg)

    @staticmethod
    def polar_stereographic(true_latitude_deg: float, longitude_deg: float):
        """Make the map about the pole of the hemisphere of its true latitude."""
        cone = 1.0 if true_latitude_deg >= 0 else -1.0
        return ConformalConic(cone, longitude_deg, true_latitude_deg)

    def project(
        self, latitude_deg: Numbers, longitude_deg: Numbers
    ) -> tuple[Numbers, Numbers]:
        """Return map coordinates [m] (Snyder 1987, eqs 15-1 and 14-4)."""
        xp = namespace(latitude_deg)
        radius = self._scale_m * _polar_tangent(latitude_deg) ** -self.cone
        angle = self.cone * xp.radians(_wrapped(longitude_deg, self.longitude_deg))
        return radius * xp.sin(angle), -radius * xp.cos(angle)

    def places(self, x_m: Numbers, y_m: Numbers) -> tuple[Numbers, Numbers]:
        """Return latitude and longitude [degrees]."""
        sign = np.sign(self.cone)
        radius = np.maximum(np.hypot(x_m, y_m), 1e-6)
        angle = np.arctan2(sign * x_m, -sign * y_m)
        tangent = (radius / abs(self._scale_m)) ** (-1 / self.cone)
        latitude = 2 * np.degrees(np.arctan(tangent)) - 90
        return latitude, _east(self.longitude_deg + np.degrees(angle) / self.cone)

    def heading_rad(self, latitude_deg: Numbers, longitude_deg: Numbers) -> Numbers:
        """Return the convergence of the meridians [rad]."""
        del latitude_deg
        return self.cone * np.radians(_wrapped(longitude_deg, self.longitude_deg))

    @property
    def _scale_m(self) -> float:
        φ = self.true_latitude_deg
        cos = np.cos(np.radians(φ))
        if abs(self.cone) == 1:
            # (1 + sin φ), which stays where the map is true at the pole itself.
            return MODEL_RADIUS_M * self.cone * (1 + np.sin(np.radians(abs(φ))))
        return MODEL_RADIUS_M * cos * _polar_tangent(φ) ** self.cone / self.cone


@dataclass(frozen=True)
class Mercator(AbstractMapProjection):
    """A `Mercator` map has straight meridians and parallels and true angles.

    **Fields:** `longitude_deg`: in the middle; `true_latitude_deg`: where lengths are
    true.
    """

    longitude_deg: float
    true_latitude_deg: float

    def project(
        self, latitude_deg: Numbers, longitude_deg: Numbers
    ) -> tuple[Numbers, Numbers]:
        """Return map coordinates [m] (Snyder 1987, eqs 7-1 and 7-2)."""
        xp = namespace(latitude_deg)
        east = xp.radians(_wrapped(longitude_deg, self.longitude_deg))
        return self._scale_m * east, self._scale_m * xp.log(
            _polar_tangent(latitude_deg)
        )

    def places(self, x_m: Numbers, y_m: Numbers) -> tuple[Numbers, Numbers]:
        """Return latitude and longitude [degrees]."""
        latitude = 2 * np.degrees(np.arctan(np.exp(y_m / self._scale_m))) - 90
        return latitude, _east(self.longitude_deg + np.degrees(x_m / self._scale_m))

    def heading_rad(self, latitude_deg: Numbers, longitude_deg: Numbers) -> Numbers:
        """Return zero: north is up everywhere."""
        return np.zeros(np.broadcast_shapes(latitude_deg.shape, longitude_deg.shape))

    @property
    def _scale_m(self) -> float:
        return MODEL_RADIUS_M * float(np.cos(np.radians(self.true_latitude_deg)))


@dataclass(frozen=True)
class LatLonMap(AbstractMapProjection):
    """A `LatLonMap` has latitude and longitude for axes, of a globe that may be turned.

    **Fields:**

    - `longitude_deg`: in the middle, of the turned globe.
    - `pole_latitude_deg`, `pole_longitude_deg`: where its north pole is.
    """

    longitude_deg: float
    pole_latitude_deg: float = 90.0
    pole_longitude_deg: float = 0.0

    def project(
        self, latitude_deg: Numbers, longitude_deg: Numbers
    ) -> tuple[Numbers, Numbers]:
        """Return longitude and latitude of the turned globe times its radius [m]."""
        xp = namespace(latitude_deg)
        latitude, longitude = self._turned(latitude_deg, longitude_deg)
        east = xp.radians(_wrapped(longitude, self.longitude_deg))
        return MODEL_RADIUS_M * east, MODEL_RADIUS_M * xp.radians(latitude)

    def places(self, x_m: Numbers, y_m: Numbers) -> tuple[Numbers, Numbers]:
        """Return latitude and longitude [degrees]."""
        longitude = self.longitude_deg + np.degrees(x_m / MODEL_RADIUS_M)
        latitude = np.degrees(y_m / MODEL_RADIUS_M)
        if self.pole_latitude_deg == 90:
            return latitude, _east(longitude)
        # Each globe sees the other's pole alike, but from the other side.
        back, along = _about_pole(latitude, longitude + 180, self.pole_latitude_deg)
        return back, _east(along + 180 + self.pole_longitude_deg)

    def heading_rad(self, latitude_deg: Numbers, longitude_deg: Numbers) -> Numbers:
        """Return the angle between the meridians of the two globes."""
        if self.pole_latitude_deg == 90:
            return 0 * latitude_deg * longitude_deg
        φ, pole = np.radians(latitude_deg), np.radians(self.pole_latitude_deg)
        away = np.radians(longitude_deg - self.pole_longitude_deg)
        # The bearing of the turned globe's pole.
        east = -np.sin(away) * np.cos(pole)
        north = np.cos(φ) * np.sin(pole) - np.sin(φ) * np.cos(pole) * np.cos(away)
        return np.arctan2(east, north)

    def _turned(self, latitude_deg, longitude_deg):
        if self.pole_latitude_deg == 90:
            return latitude_deg, longitude_deg
        away = longitude_deg - self.pole_longitude_deg
        return _about_pole(latitude_deg, away, self.pole_latitude_deg)


@dataclass(frozen=True)
class LocalPlane(AbstractMapProjection):
    """A `LocalPlane` is true along all lines through its middle; for ideal runs.

    It is the azimuthal equidistant map (Snyder 1987, eqs 22-4 and 22-5).

    **Fields:** `latitude_deg`, `longitude_deg`: of the middle.
    """

    latitude_deg: float
    longitude_deg: float

    def project(
        self, latitude_deg: Numbers, longitude_deg: Numbers
    ) -> tuple[Numbers, Numbers]:
        """Return the distances [m] to the east and to the north."""
        xp = namespace(latitude_deg)
        east, north, up = self._local(latitude_deg, longitude_deg)
        level = xp.hypot(east, north)
        per = MODEL_RADIUS_M * xp.arctan2(level, up) / xp.maximum(level, 1e-30)
        per = xp.where(level > 1e-12, per, MODEL_RADIUS_M)
        return per * east, per * north

    def places(self, x_m: Numbers, y_m: Numbers) -> tuple[Numbers, Numbers]:
        """Return latitude and longitude [degrees]."""
        arc = np.hypot(x_m, y_m) / MODEL_RADIUS_M
        per = np.sinc(arc / np.pi) / MODEL_RADIUS_M
        east, north, up = per * x_m, per * y_m, np.cos(arc)
        φ = np.radians(self.latitude_deg)
        out = up * np.cos(φ) - north * np.sin(φ)
        axis = np.clip(north * np.cos(φ) + up * np.sin(φ), -1, 1)
        longitude = self.longitude_deg + np.degrees(np.arctan2(east, out))
        return np.degrees(np.arcsin(axis)), _east(longitude)

    def heading_rad(self, latitude_deg: Numbers, longitude_deg: Numbers) -> Numbers:
        """Return the turn of the meridians, by differences along a meridian."""
        step = 1e-5
        x0, y0 = self.project(latitude_deg - step, longitude_deg)
        x1, y1 = self.project(latitude_deg + step, longitude_deg)
        return np.arctan2(-(x1 - x0), y1 - y0)

    def _local(self, latitude_deg, longitude_deg):
        xp = namespace(latitude_deg)
        φ, φ0 = xp.radians(latitude_deg), np.radians(self.latitude_deg)
        λ = xp.radians(longitude_deg - self.longitude_deg)
        out = xp.cos(φ) * xp.cos(λ)
        north = xp.sin(φ) * np.cos(φ0) - out * np.sin(φ0)
        up = out * np.cos(φ0) + xp.sin(φ) * np.sin(φ0)
        return xp.cos(φ) * xp.sin(λ), north, up


def _polar_tangent(latitude_deg):
    xp = namespace(latitude_deg)
    return xp.tan(np.pi / 4 + xp.radians(latitude_deg) / 2)


def _wrapped(longitude_deg, centre_deg: float):
    """Longitudes from a meridian, within 180° of it."""
    return (longitude_deg - centre_deg + 180) % 360 - 180


def _east(longitude_deg):
    return (longitude_deg + 180) % 360 - 180


def _about_pole(latitude_deg, away_deg, pole_latitude_deg: float):
    """Latitude and longitude about another pole, longitudes from its own meridian."""
    xp = namespace(latitude_deg)
    φ, λ = xp.radians(latitude_deg), xp.radians(away_deg)
    pole = np.radians(pole_latitude_deg)
    axis = np.sin(pole) * xp.sin(φ) + np.cos(pole) * xp.cos(φ) * xp.cos(λ)
    along = np.sin(pole) * xp.cos(φ) * xp.cos(λ) - np.cos(pole) * xp.sin(φ)
    longitude = xp.degrees(xp.arctan2(xp.cos(φ) * xp.sin(λ), along))
    return xp.degrees(xp.arcsin(xp.clip(axis, -1, 1))), longitude
