"""What an analysis tells of its clouds: covers of layers, and what tells classes apart.

Of each layer's cover the first source that the file allows serves:

1. the cover of the layer, of the time itself or as a mean over the hours before;
2. cloud covers on pressure levels, the greatest within the layer;
3. cloud water and ice with humidity (Xu & Randall 1996);
4. relative humidity, for low cloud with vertical motion and stability (Slingo 1987).
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import expit

from cloudjax.weather.evidence import (
    LAYERS,
    ascent_factor,
    condensate_cover,
    humidity_cover,
    inversion_cover,
)
from cloudjax_data import WeatherCube
from cloudjax_data.humidity import specific_humidity

from .weather_stability import (
    inversion_strength_k,
    most_stable,
    tropopause_m,
)


Field = Float[np.ndarray, "lat lon"]
Levels = Float[np.ndarray, "level lat lon"]

# The GFS's own limits of low and middle cloud [hPa], up to 45 degrees and at the poles.
_LOW_TOP_HPA, _MIDDLE_TOP_HPA = (642.0, 750.0), (350.0, 500.0)
# Convective cloud whose top is above is deep, softly.
_DEEP_HPA, _DEEP_WIDTH_HPA = 350.0, 50.0
# Where nothing but instability tells: energy [J/kg], ascent at 500 hPa [Pa/s], and the
# cover that deep convection of both has. These numbers are ours.
_UNSTABLE, _RISING, _CONVECTIVE_COVER = (500.0, 250.0), (0.1, 0.05), 0.3


@dataclass(frozen=True, eq=False)
class SkyEvidence:
    """`SkyEvidence` is what an analysis tells of its clouds.

    **Fields:**

    - `covers`: of the layers low, middle and high, 0 to 1.
    - `quantities`: by the names of `cloudjax.weather.evidence.QUANTITIES`.
    - `said`: what each is taken from, by the same names, in words.
    """

    covers: Mapping[str, Field]
    quantities: Mapping[str, Field]
    said: Mapping[str, str]

    @staticmethod
    def of(cube: WeatherCube) -> "SkyEvidence":
        """Find it in an analysis on latitudes and longitudes."""
        covers, said = {}, {}
        for layer in LAYERS:
            source = next(s for s in _SOURCES if s.serves(cube, layer))
            covers[layer] = np.clip(np.nan_to_num(source.cover(cube, layer)), 0, 1)
            said[layer] = source.words(cube, layer)
        quantities = {}
        for name, find in _QUANTITIES.items():
            quantities[name], said[name] = find(cube)
        return SkyEvidence(covers, quantities, said)


def layers_by_pressure(
    hpa: Float[np.ndarray, "*#n"], latitude_deg: Float[np.ndarray, "*#n"]
) -> dict[str, Bool[np.ndarray, "*n"]]:
    """Tell in which of the layers low, middle and high pressures [hPa] are, by the
    GFS's limits, up to 45 degrees and linear from there to the poles. NaN is in none.
    """
    polar = np.clip(np.abs(latitude_deg) / 45 - 1, 0, 1)
    low, middle = (
        equator + (pole - equator) * polar
        for equator, pole in (_LOW_TOP_HPA, _MIDDLE_TOP_HPA)
    )
    return {
        "low": hpa >= low,
        "middle": (hpa < low) & (hpa >= middle),
        "high": hpa < middle,
    }


class _Source(ABC):
    """A way to find the cover of a layer."""

    @abstractmethod
    def serves(self, cube: WeatherCube, layer: str) -> bool:
        """Whether the file has what it needs."""

    @abstractmethod
    def cover(self, cube: WeatherCube, layer: str) -> Field:
        """The cover, 0 to 1, NaN where nothing is known."""

    @abstractmethod
    def words(self, cube: WeatherCube, layer: str) -> str:
        """What it is taken from."""


class _LayerCover(_Source):
    def serves(self, cube, layer):
        return f"cover_{layer}" in cube.data

    def cover(self, cube, layer):
        return _field(cube, f"cover_{layer}") / 100

    def words(self, cube, layer):
        mean = f"cover_{layer}" in cube.means
        return f"the file's cover of {layer} cloud" + (
            ", a mean over the hours before" if mean else ""
        )


class _LevelCovers(_Source):
    def serves(self, cube, layer):
        return "tcc" in cube.data

    def cover(self, cube, layer):
        return _greatest(_field(cube, "tcc") / 100, cube, layer)

    def words(self, cube, layer):
        return "the file's covers on pressure levels"


class _Condensate(_Source):
    def serves(self, cube, layer):
        return "clwmr" in cube.data

    def cover(self, cube, layer):
        water = np.nan_to_num(_field(cube, "clwmr"))
        if "icmr" in cube.data:
            water = water + np.nan_to_num(_field(cube, "icmr"))
        humidity, kelvin = _field(cube, "r"), _field(cube, "t")
        saturated = specific_humidity(np.full_like(kelvin, 100.0), kelvin, _hpa(cube))
        found = np.asarray(condensate_cover(humidity / 100, saturated, water))
        return _greatest(found, cube, layer)

    def words(self, cube, layer):
        ice = " and ice" if "icmr" in cube.data else ""
        return f"cloud water{ice} and humidity (Xu & Randall 1996)"


class _Humidity(_Source):
    def serves(self, cube, layer):
        return True

    def cover(self, cube, layer):
        humid = np.asarray(humidity_cover(_field(cube, "r") / 100))
        if layer != "low":
            return _greatest(humid, cube, layer)
        rising = humid * np.asarray(ascent_factor(_field(cube, "w")))
        stable = inversion_cover(*most_stable(cube, _heights_known(cube)))
        return np.fmax(_greatest(rising, cube, layer), np.asarray(stable))

    def words(self, cube, layer):
        more = ", vertical motion and stability" if layer == "low" else ""
        return f"relative humidity{more} (Slingo 1987)"


_SOURCES: tuple[_Source, ...] = (
    _LayerCover(),
    _LevelCovers(),
    _Condensate(),
    _Humidity(),
)


def _greatest(values: Levels, cube: WeatherCube, layer: str) -> Field:
    """The greatest of the levels of a layer: neighbours overlap as much as they can."""
    within = _levels_of(cube, layer) & _heights_known(cube)
    return np.where(within & np.isfinite(values), values, 0.0).max(axis=0)


def _levels_of(cube: WeatherCube, layer: str) -> Bool[np.ndarray, "level lat lon"]:
    latitude = cube.data["latitude"].to_numpy()[None, :, None]
    return layers_by_pressure(_hpa(cube), latitude)[layer]


def _heights_known(cube: WeatherCube) -> Bool[np.ndarray, "level lat lon"]:
    """Levels that are above the ground."""
    height = _field(cube, "gh")
    if "orog" not in cube.data:
        return np.isfinite(height)
    return height > _field(cube, "orog")[None]


def _boundary_layer_share(cube: WeatherCube) -> tuple[Field, str]:
    if "cover_boundary" in cube.data and "cover_low" in cube.data:
        boundary, low = (_field(cube, f"cover_{n}") / 100 for n in ("boundary", "low"))
        share = np.clip(boundary / np.maximum(low, 0.01), 0, 1)
        return np.nan_to_num(share), "the file's cover of boundary-layer cloud"
    low = _levels_of(cube, "low") & _heights_known(cube)
    humidity = np.where(low, np.nan_to_num(_field(cube, "r")), -1.0)
    moist = np.take_along_axis(
        np.broadcast_to(_hpa(cube), humidity.shape), humidity.argmax(0)[None], axis=0
    )[0]
    return 1.0 * (moist >= 850), "the level of greatest humidity below 850 hPa or above"


def _deep_convection(cube: WeatherCube) -> tuple[Field, str]:
    if {"cover_convective", "convective_top_pa"} <= set(cube.data):
        top = np.nan_to_num(_field(cube, "convective_top_pa") / 100, nan=2e3)
        deep = expit((_DEEP_HPA - top) / _DEEP_WIDTH_HPA)
        cover = np.nan_to_num(_field(cube, "cover_convective") / 100)
        return deep * cover, "the file's cover and tops of convective cloud"
    if "cape" in cube.data:
        (middle, width), (rising, softly) = _UNSTABLE, _RISING
        unstable = expit((np.nan_to_num(_field(cube, "cape")) - middle) / width)
        ascent = expit((-_omega(cube, 500.0) - rising) / softly)
        words = "convective available potential energy and ascent at 500 hPa"
        return _CONVECTIVE_COVER * unstable * ascent, words
    none = np.zeros(_hpa(cube).shape[1:]) + np.zeros(_field(cube, "gh").shape[1:])
    return none, "nothing: no class of deep convection is placed"


def _ascent(cube: WeatherCube) -> tuple[Field, str]:
    return -_omega(cube, 700.0), "vertical motion at 700 hPa"


def _inversion(cube: WeatherCube) -> tuple[Field, str]:
    return inversion_strength_k(cube), "temperatures of 1000 and 700 hPa"


_QUANTITIES = {
    "boundary_layer_share": _boundary_layer_share,
    "inversion_k": _inversion,
    "tropopause_m": tropopause_m,
    "ascent_pa_s": _ascent,
    "deep_convection": _deep_convection,
}


def _omega(cube: WeatherCube, hpa: float) -> Field:
    level = int(np.argmin(np.abs(cube.data["level"].to_numpy() - hpa)))
    return np.nan_to_num(_field(cube, "w")[level])


def _hpa(cube: WeatherCube) -> Float[np.ndarray, "level 1 1"]:
    return cube.data["level"].to_numpy().astype(float)[:, None, None]


def _field(cube: WeatherCube, name: str) -> np.ndarray:
    return cube.data[name].to_numpy().astype(float)
