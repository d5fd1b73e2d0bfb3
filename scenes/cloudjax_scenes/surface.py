"""What is seen below the clouds where no imagery is at hand: land, sea, snow and ice.

What the ground is comes from a table of places; how warm it is, and whether snow lies
on it, from the weather. The renderer multiplies by the cosine of the solar zenith
angle. Sea and lakes mirror the sun (`cloudjax.light.sea`), by the wind that the weather
has; refraction of water: Segelstein (1981, M.S. thesis, University of Missouri, Kansas
City).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from cloudjax.geometry.geodesy import dot
from cloudjax.geometry.latlon_grid import LatLonGrid
from cloudjax.geometry.path import device_array
from cloudjax.geometry.rays import Rays
from cloudjax.light.ground import AbstractMappedGround, GroundSamples, Lambertian
from cloudjax.light.optics import LAST_SUNLIT_BAND
from cloudjax.light.sea import glint, slope_variance
from cloudjax_data import WeatherCube

from .ground_cover import SEEN_UNDER_TREES, SNOW, Ground, GroundCover, ground_cover


# Bands 1 to 7.
REFRACTION = (1.342, 1.331, 1.324, 1.314, 1.309, 1.282, 1.340)
# Of the wind over the oceans (Archer & Jacobson 2005, J. Geophys. Res. 110, D12110).
MEAN_WIND_M_S = 6.6
# Snow and ice cover half the ground at the middle, all of it at the lower end.
SNOW_K = (260.0, 270.0)
STANDARD_K = 288.15
LAPSE_K_M = 6.5e-3

# Of the wind over the sea, and of the sea for it.
_WIND_HEIGHT_M, _ROUGHNESS_M = 10.0, 2e-4


class Surface(AbstractMappedGround):
    """Ground and sea of a table of places, as warm as the weather says.

    **Fields:**

    - `table`: what the ground is.
    - `skin_k`: temperature of the skin at the nodes of `weather_grid`.
    - `height_m`: of the ground above sea level, there too.
    - `wind_m_s`: over the sea, there too.
    """

    table: GroundCover = eqx.field(static=True)
    skin_k: Float[np.ndarray, "lat lon"]
    height_m: Float[np.ndarray, "lat lon"]
    wind_m_s: Float[np.ndarray, "lat lon"]
    weather_grid: LatLonGrid

    @classmethod
    def of(cls, cube: WeatherCube | None = None) -> "Surface":
        """Make it from weather; without, it is at 288.15 K everywhere, at sea level,
        in a wind of 6.6 m/s.

        The temperature is that of the skin where the weather has it, else of the lowest
        air above ground, brought down by 6.5 K/km; beyond a regional analysis the mean
        of what it has.
        """
        if cube is None:
            grid = LatLonGrid.from_axes(np.array([-90.0, 90.0]), np.arange(0, 360, 120))
            kelvin = np.full(grid.shape, STANDARD_K)
            return cls.as_warm_as(kelvin, np.zeros(grid.shape), grid)
        data = cube.regular(0.25).data
        axes = (data[axis].to_numpy() for axis in ("latitude", "longitude"))
        kelvin = _skin(data)
        height = np.zeros(kelvin.shape)
        if "orog" in data:
            height = np.nan_to_num(data["orog"].to_numpy().astype(np.float64))
        grid = LatLonGrid.from_axes(*axes)
        return cls(ground_cover(), kelvin, height, _wind(data), grid)

    @classmethod
    def as_warm_as(
        cls,
        air_k: Float[np.ndarray, "lat lon"],
        height_m: Float[np.ndarray, "lat lon"],
        grid: LatLonGrid,
        wind_m_s: Float[np.ndarray, "lat lon"] | None = None,
    ) -> "Surface":
        """Make it as warm as air next to the ground, at heights, at places.

        **Arguments:** `wind_m_s`: at 10 m; by default 6.6 m/s.
        """
        wind = np.full(grid.shape, MEAN_WIND_M_S) if wind_m_s is None else wind_m_s
        return cls(ground_cover(), air_k, height_m, wind, grid)

    def towards(self, later: "Surface", weight: int | float) -> "Surface":
        """Mix the skin's temperature and the wind with those of a later time.

        **Arguments:** `later`: on the same grid. `weight`: of it, from 0 to 1.
        """
        kelvin, wind = (
            (1 - weight) * one + weight * other
            for one, other in (
                (self.skin_k, later.skin_k),
                (self.wind_m_s, later.wind_m_s),
            )
        )
        return replace(self, skin_k=kelvin, wind_m_s=wind)

    def look(
        self, rays, places, hit, sun_direction, reflective, emissive
    ) -> GroundSamples:
        """Read what the ground is like at the places."""
        cover = self.cover(places.latitude_deg, places.longitude_deg)
        albedo = emissivity = mirrored = None
        if reflective is not None:
            numbers = reflective.numbers
            albedo = device_array(cover.reflectance(numbers).T)
            mirrored = cover.glint(numbers, rays, places.upward, sun_direction).T
        if emissive is not None:
            emissivity = device_array(cover.emissivity(emissive.numbers).T)
        return GroundSamples.of(
            places,
            hit,
            sun_direction,
            cover.altitude_m,
            Lambertian(albedo, emissivity, device_array(cover.temperature_k), mirrored),
        )

    def cover(
        self,
        latitude_deg: Float[np.ndarray, " points"],
        longitude_deg: Float[np.ndarray, " points"],
    ) -> "Cover":
        """Interpolate all that the ground is like to places, bilinear."""
        fields = [self.skin_k, self.height_m, self.wind_m_s]
        found = self.weather_grid.sample_all(fields, latitude_deg, longitude_deg)
        kelvin, altitude, wind = map(np.asarray, found)
        ground = self.table.at(latitude_deg, longitude_deg)
        return Cover(ground, kelvin, np.maximum(altitude, 0.0), wind)

    def land_at(
        self,
        latitude_deg: Float[np.ndarray, " points"],
        longitude_deg: Float[np.ndarray, " points"],
    ) -> Float[np.ndarray, " points"]:
        """Interpolate the share of land; between 0 and 1 within 11 km of a coast.

        Lakes are land.
        """
        return self.table.land_at(latitude_deg, longitude_deg)


@dataclass(frozen=True, eq=False)
class Cover:
    """A `Cover` is what the ground is like at some places.

    **Fields:**

    - `ground`: shares of its kinds.
    - `temperature_k`: of the skin.
    - `altitude_m`: of the ground, at least 0.
    - `wind_m_s`: over water.
    """

    ground: Ground
    temperature_k: Float[np.ndarray, " points"]
    altitude_m: Float[np.ndarray, " points"]
    wind_m_s: Float[np.ndarray, " points"]

    def reflectance(self, bands: Sequence[int]) -> Float[np.ndarray, "bands points"]:
        """Give the Lambertian albedo in bands that see the sun, numbers 1 to 7."""
        snow = self._snow * (1 - (1 - SEEN_UNDER_TREES) * self.ground.forest)
        white = np.array([SNOW[band - 1] for band in bands])
        return snow * white[:, None] + (1 - snow) * self.ground.reflectance(bands)

    def emissivity(self, bands: Sequence[int]) -> Float[np.ndarray, "bands points"]:
        """Give one less the albedo at 3.9 µm, that of bare ground beyond; numbers 7 to
        16.

        All else is black there, snow with it.
        """
        rows = np.empty((len(bands), len(self.temperature_k)))
        for row, band in zip(rows, bands, strict=True):
            if band == LAST_SUNLIT_BAND:
                row[:] = 1 - self.reflectance([band])[0]
            else:
                bare = self.ground.emissivity([band])[0]
                row[:] = 1 - (1 - self._snow) * (1 - bare)
        return rows

    def glint(
        self,
        bands: Sequence[int],
        rays: Rays,
        upward: Float[np.ndarray, "rays 3"],
        sun_direction: Float[np.ndarray, "3"],
    ) -> Float[Array, "bands rays"]:
        """Give the reflectance factor of the sun's mirror image in water without ice,
        in bands 1 to 7, where rays meet the ground.

        **Arguments:** `upward`: of the places, unit vectors, ECEF.
        """
        return _glint(
            device_array(self.ground.water * (1 - self._snow)),
            device_array(upward @ sun_direction),
            device_array(-dot(upward, rays.direction)),
            device_array(rays.direction @ sun_direction),
            device_array(self.wind_m_s),
            jnp.asarray([REFRACTION[band - 1] for band in bands], float),
        )

    @property
    def _snow(self) -> Float[np.ndarray, " points"]:
        """The share of snow and ice by temperature, on the ground."""
        cold, warm = SNOW_K
        return np.clip((warm - self.temperature_k) / (warm - cold), 0, 1)


@jax.jit
def _glint(water, sun, view, scattering, wind_m_s, refraction):
    found = glint(sun, view, scattering, slope_variance(wind_m_s), refraction)
    return water[None] * found


def wind_at_10_m(
    speed_m_s: Float[np.ndarray, "*n"], above_m: Float[np.ndarray, "*n"]
) -> Float[np.ndarray, "*n"]:
    """Return the wind at 10 m by that higher up, by the law of the wall over waves."""
    above = np.maximum(above_m, _WIND_HEIGHT_M)
    slower = np.log(_WIND_HEIGHT_M / _ROUGHNESS_M) / np.log(above / _ROUGHNESS_M)
    return speed_m_s * slower


def _wind(data) -> Float[np.ndarray, "lat lon"]:
    above, u, v = _at_ground(data, "u", "v")
    speed = wind_at_10_m(np.hypot(u, v), above).astype(np.float64)
    return np.where(np.isfinite(speed), speed, MEAN_WIND_M_S)


def _skin(data) -> Float[np.ndarray, "lat lon"]:
    if "t_surface" in data:
        field = data["t_surface"].to_numpy()
    else:
        above, air = _at_ground(data, "t")
        field = air + LAPSE_K_M * above
    field = field.astype(np.float64)
    return np.where(np.isfinite(field), field, np.nanmean(field))


def _at_ground(data, *names: str) -> list[Float[np.ndarray, "lat lon"]]:
    """The height above ground of the lowest air that is known, and fields there; NaN
    where none is.
    """
    height, *fields = (data[name].to_numpy() for name in ("gh", *names))
    above = height - (data["orog"].to_numpy() if "orog" in data else 0.0)
    known = np.isfinite(above) & (above >= 0) & np.isfinite(fields).all(axis=0)
    lowest = known.argmax(axis=0)[None]
    taken = (np.take_along_axis(field, lowest, axis=0)[0] for field in (above, *fields))
    return [np.where(known.any(axis=0), field, np.nan) for field in taken]
