"""What is seen below the clouds where no imagery is at hand: land, sea, snow and ice.

Reflectances are round numbers within what is published, the same for all land: they
serve to put clouds over something plausible. The renderer multiplies by the cosine of
the solar zenith angle.

- sea: Fresnel's reflection of skylight, whitecaps, and light from below in the blue;
  and the glint of the sun (`cloudjax.light.sea`), by the wind that the weather has.
- vegetation: 0.47 and 0.64 µm are near the quarter and the half of 2.2 µm that Kaufman
  et al. (1997, IEEE TGRS 35, 1286) find over dark vegetation.
- bare ground: dry soil and sand, as in the ECOSTRESS spectral library (Baldridge et al.
  2009, Remote Sens. Environ. 113, 711; Meerdink et al. 2019, ibid. 230, 111196).
- snow and ice: bright in the visible, about 0.05 at 2.13 µm (Moody et al. 2007, Remote
  Sens. Environ. 111, 337).
- 3.9 µm: one less the emissivity of sea (Masuda et al. 1988, Remote Sens. Environ. 24,
  313), plants and soil (Seemann et al. 2008, J. Appl. Meteorol. Climatol. 47, 108) and
  snow (Dozier & Warren 1982, Water Resour. Res. 18, 1219).
- refraction of water: Segelstein (1981, M.S. thesis, University of Missouri, Kansas
  City).
"""

import functools as ft
import importlib.resources
from collections.abc import Sequence
from dataclasses import dataclass

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


# Bands 1 to 7: 0.47, 0.64, 0.87, 1.38, 1.61, 2.25 and 3.9 µm.
SEA = (0.045, 0.030, 0.015, 0.010, 0.008, 0.005, 0.02)
VEGETATION = (0.03, 0.06, 0.32, 0.24, 0.20, 0.11, 0.04)
BARE = (0.14, 0.26, 0.36, 0.42, 0.44, 0.40, 0.25)
SNOW = (0.80, 0.80, 0.70, 0.40, 0.10, 0.05, 0.03)
REFRACTION = (1.342, 1.331, 1.324, 1.314, 1.309, 1.282, 1.340)
# Of the wind over the oceans (Archer & Jacobson 2005, J. Geophys. Res. 110, D12110).
MEAN_WIND_M_S = 6.6
# About a third of all land is arid.
BARE_SHARE = 1 / 3
# Snow and ice cover half the ground at the middle, all of it at the lower end.
SNOW_K = (260.0, 270.0)
STANDARD_K = 288.15
LAPSE_K_M = 6.5e-3

# Of the wind over the sea, and of the sea for it.
_WIND_HEIGHT_M, _ROUGHNESS_M = 10.0, 2e-4
_CELL_DEG = 0.1
_LEVELS = 15


class Surface(AbstractMappedGround):
    """Ground and sea of a table of land, as warm as the weather says.

    **Fields:**

    - `land_share`: 0 at sea, 1 on land, at the nodes of `land_grid`.
    - `skin_k`: temperature of the skin at the nodes of `weather_grid`.
    - `height_m`: of the ground above sea level, there too.
    - `wind_m_s`: over the sea, there too.
    """

    land_share: Float[np.ndarray, "rows columns"]
    land_grid: LatLonGrid
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
        return cls(*_land_share(), kelvin, height, _wind(data), grid)

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
        return cls(*_land_share(), air_k, height_m, wind, grid)

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
        land = self.land_at(latitude_deg, longitude_deg)
        return Cover(land, kelvin, np.maximum(altitude, 0.0), wind)

    def land_at(
        self,
        latitude_deg: Float[np.ndarray, " points"],
        longitude_deg: Float[np.ndarray, " points"],
    ) -> Float[np.ndarray, " points"]:
        """Interpolate the share of land; between 0 and 1 within 11 km of a coast.

        Lakes are land.
        """
        share = self.land_grid.sample_all(
            [self.land_share], latitude_deg, longitude_deg
        )
        return np.asarray(share[0])


@dataclass(frozen=True, eq=False)
class Cover:
    """A `Cover` is what the ground is like at some places.

    **Fields:**

    - `land`: share of land; between 0 and 1 within 11 km of a coast.
    - `temperature_k`: of the skin.
    - `altitude_m`: of the ground, at least 0.
    - `wind_m_s`: over the sea.
    """

    land: Float[np.ndarray, " points"]
    temperature_k: Float[np.ndarray, " points"]
    altitude_m: Float[np.ndarray, " points"]
    wind_m_s: Float[np.ndarray, " points"]

    def reflectance(self, bands: Sequence[int]) -> Float[np.ndarray, "bands points"]:
        """Give the Lambertian albedo in bands that see the sun, numbers 1 to 7."""
        rows, snow = [], self._snow
        for band in bands:
            i = band - 1
            ground = BARE_SHARE * BARE[i] + (1 - BARE_SHARE) * VEGETATION[i]
            bare = self.land * ground + (1 - self.land) * SEA[i]
            rows.append(snow * SNOW[i] + (1 - snow) * bare)
        return np.stack(rows)

    def emissivity(self, bands: Sequence[int]) -> Float[np.ndarray, "bands points"]:
        """Give one less the albedo at 3.9 µm and one beyond, numbers 7 to 16."""
        rows = np.ones((len(bands), len(self.land)))
        for row, band in zip(rows, bands, strict=True):
            if band == LAST_SUNLIT_BAND:
                row -= self.reflectance([band])[0]
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
            device_array((1 - self.land) * (1 - self._snow)),
            device_array(upward @ sun_direction),
            device_array(-dot(upward, rays.direction)),
            device_array(rays.direction @ sun_direction),
            device_array(self.wind_m_s),
            jnp.asarray([REFRACTION[band - 1] for band in bands], float),
        )

    @property
    def _snow(self) -> Float[np.ndarray, " points"]:
        """The share of snow and ice."""
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


@ft.cache
def _land_share() -> tuple[np.ndarray, LatLonGrid]:
    file = importlib.resources.files("cloudjax_scenes") / "land_share.npz"
    with file.open("rb") as stream, np.load(stream) as content:
        packed = content["share"]
    level = np.stack([packed >> 4, packed & 15], axis=-1).reshape(len(packed), -1)
    rows, columns = level.shape
    grid = LatLonGrid.from_axes(
        _CELL_DEG * (np.arange(rows) + 0.5) - 90,
        _CELL_DEG * (np.arange(columns) + 0.5) - 180,
    )
    return (level / np.float32(_LEVELS)).astype(np.float32), grid
