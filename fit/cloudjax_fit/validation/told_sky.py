"""What an analysis tells of the sky over the pixels of an image."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from jaxtyping import Bool, Float

from cloudjax.air.atmosphere import pressure_pa
from cloudjax.geometry.geodesy import MEAN_RADIUS_M
from cloudjax.geometry.latlon_grid import LatLonGrid
from cloudjax_data import DataError, WeatherCube
from cloudjax_fit.time_apart import SLACK, in_words
from cloudjax_scenes.weather_evidence import SkyEvidence


Pixels = Float[np.ndarray, " pixels"]
# Of a Lambert map, when it is laid on latitudes and longitudes.
_STEP_DEG = 0.25
_LEAST_SHARE = 0.5
# Below the lowest level that is given pressure grows by e over so many metres.
_SCALE_M = 8e3


@dataclass(frozen=True, eq=False)
class ToldSky:
    """`ToldSky` is an analysis over some places.

    **Fields:**

    - `covers`: of the layers low, middle and high, 0 to 1, whatever is above them.
    - `total`: cover of all cloud, 0 to 1; `total_words` says whence.
    - `convection`: fraction of the sky under deep convective cloud.
    - `said`: what covers and convection are taken from, in words.
    """

    covers: Mapping[str, Pixels]
    total: Pixels
    total_words: str
    convection: Pixels
    said: Mapping[str, str]

    @property
    def independent(self) -> Pixels:
        """Give the cover of all layers, were they independent, as a render has them."""
        return _independent(self.covers)

    @property
    def seen(self) -> dict[str, Pixels]:
        """Give the covers as seen from above, past higher layers that are independent:
        high, middle (1 - high), and low (1 - middle) (1 - high).
        """
        low, middle, high = (self.covers[name] for name in ("low", "middle", "high"))
        return {
            "total": self.total,
            "high": high,
            "middle": middle * (1 - high),
            "low": low * (1 - middle) * (1 - high),
        }


def _independent(covers: Mapping[str, Pixels]) -> Pixels:
    return 1 - (1 - covers["low"]) * (1 - covers["middle"]) * (1 - covers["high"])


def told_sky(cube: WeatherCube, latitude_deg: Pixels, longitude_deg: Pixels) -> ToldSky:
    """Find the sky of an analysis at places that it holds, linear between its own."""
    regular = cube.regular(_STEP_DEG)
    at = _Places(regular, latitude_deg, longitude_deg)
    sky = SkyEvidence.of(regular)
    covers = {name: at(cover) for name, cover in sky.covers.items()}
    convection = at(sky.quantities["deep_convection"])
    total, words = _independent(covers), "layers that are independent of each other"
    if "cover_total" in regular.data:
        field = np.nan_to_num(regular.data["cover_total"].to_numpy().astype(float))
        mean = ", a mean over the hours before" if "cover_total" in cube.means else ""
        total, words = np.clip(at(field / 100), 0, 1), f"the file's total cover{mean}"
    return ToldSky(covers, total, words, convection, sky.said)


def top_pressures_hpa(
    cube: WeatherCube, latitude_deg: Pixels, longitude_deg: Pixels, top_m: Pixels
) -> Pixels:
    """Return the pressures [hPa] at altitudes, by the analysis's heights of its levels:
    the logarithm of pressure is linear in height between them.

    Below the lowest level that is given it grows as in air with a scale height of 8 km,
    above the highest it is that of the US standard atmosphere. NaN for NaN.
    """
    regular = cube.regular(_STEP_DEG)
    at = _Places(regular, latitude_deg, longitude_deg)
    levels = regular.data["level"].to_numpy().astype(float)
    heights = regular.data["gh"].to_numpy().astype(float)
    # Geopotential metres, by a sphere: z = R h / (R - h).
    altitudes = MEAN_RADIUS_M * heights / (MEAN_RADIUS_M - heights)
    found = np.full(top_m.shape, np.nan)
    below_m, below_hpa = np.full(top_m.shape, np.nan), np.full(top_m.shape, np.nan)
    for level, altitude in zip(levels, altitudes, strict=True):
        z = at(altitude)
        first = np.isnan(below_m) & np.isfinite(z) & (top_m < z)
        found = np.where(first, level * np.exp((z - top_m) / _SCALE_M), found)
        between = (below_m <= top_m) & (top_m < z)
        share = np.where(between, top_m - below_m, 0.0)
        share = share / np.where(between, z - below_m, 1.0)
        inside = below_hpa * (level / below_hpa) ** share
        found = np.where(between, inside, found)
        given = np.isfinite(z)
        below_m, below_hpa = (
            np.where(given, z, below_m),
            np.where(given, level, below_hpa),
        )
    above = np.isnan(found) & np.isfinite(top_m)
    standard = np.asarray(pressure_pa(np.where(above, top_m, 0.0)), float) / 100
    return np.where(above, standard, found)


def held_pixels(
    cube: WeatherCube,
    name: str,
    latitude_deg: Pixels,
    longitude_deg: Pixels,
    area_m2: Pixels,
) -> Bool[np.ndarray, " pixels"]:
    """Tell which places an analysis holds.

    **Raises:** `DataError` where that is less than half of the area.
    """
    held = cube.holds(latitude_deg, longitude_deg)
    share = float((held * area_m2).sum() / area_m2.sum())
    if share < _LEAST_SHARE:
        raise DataError(
            f"{cube.path} covers {cube.extent}, {share:.0%} of what {name} shows: give "
            "the analysis by which it was rendered."
        )
    return held


def check_close(
    cube: WeatherCube, name: str, time: datetime, allow_mismatch: bool
) -> str:
    """Return a sentence on the times if an analysis is of another than an image, else
    nothing.

    **Raises:** `DataError` if it is, more than half an hour, and that is not allowed.
    """
    apart = abs(cube.valid_time - time)
    if apart <= SLACK:
        return ""
    said = (
        f"{cube.path} is of {cube.valid_time:%Y-%m-%d %H:%M} UTC and {name} of "
        f"{time:%Y-%m-%d %H:%M}, {in_words(apart)} apart"
    )
    if not allow_mismatch:
        raise DataError(
            f"{said}: give the analysis by which it was rendered, or compare with "
            "--allow-mismatch."
        )
    return f"{said}: clouds have moved."


class _Places:
    """Takes fields of an analysis to places."""

    def __init__(self, regular: WeatherCube, latitude_deg, longitude_deg):
        axes = (regular.data[axis].to_numpy() for axis in ("latitude", "longitude"))
        self.grid = LatLonGrid.from_axes(*axes)
        first = self.grid.longitude.first
        self.latitude_deg = latitude_deg
        # A region's axis does not repeat itself.
        self.longitude_deg = first + np.mod(longitude_deg - first, 360)

    def __call__(self, field: Float[np.ndarray, "lat lon"]) -> Pixels:
        found = self.grid.sample(
            np.asarray(field, float)[..., None], self.latitude_deg, self.longitude_deg
        )
        return np.asarray(found, float)[..., 0]
