"""Temperature and humidity of the air above any place, from a weather analysis."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from cloudjax import LatLonGrid, ProfileGrid
from cloudjax.air.atmosphere import temperature_k
from cloudjax.air.gases import LEVELS_M, standard_humidity
from cloudjax_data import WeatherCube, specific_humidity


def profiles_of(cube: WeatherCube) -> ProfileGrid:
    """Make the profiles of an analysis on latitudes and longitudes.

    Below the ground the first air above it, above the highest level the US standard
    atmosphere; NaN outside of a map.
    """
    data = cube.data
    humidity = specific_humidity(
        data["r"].to_numpy(),
        data["t"].to_numpy(),
        data["level"].to_numpy()[:, None, None],
    )
    kept = [name for name in ("gh", "t", "orog") if name in data]
    moist = data[kept].assign(q=(data["t"].dims, humidity))
    moister = replace(cube, data=moist)
    levels = [moister.at_altitude(float(z)) for z in LEVELS_M]
    fields = [
        _filled(np.stack([at[name].to_numpy() for at in levels], axis=-1), top)
        for name, top in (
            ("t", np.asarray(temperature_k(LEVELS_M))),
            ("q", standard_humidity()),
        )
    ]
    axes = (data[axis].to_numpy() for axis in ("latitude", "longitude"))
    kelvin, q = (field.astype(np.float32) for field in fields)
    return ProfileGrid(kelvin, q, LatLonGrid.from_axes(*axes))


def mean_profile(
    profiles: ProfileGrid,
    latitude_deg: Float[np.ndarray, " points"],
    longitude_deg: Float[np.ndarray, " points"],
) -> tuple[Float[np.ndarray, " levels"], Float[np.ndarray, " levels"]]:
    """Average over those of the places that the profiles cover.

    The US standard atmosphere where they cover none.
    """
    found = profiles(latitude_deg, longitude_deg)
    kelvin, humidity = (np.asarray(each) for each in found)
    known = (np.isfinite(kelvin) & np.isfinite(humidity)).all(axis=-1)
    if not known.any():
        return np.asarray(temperature_k(LEVELS_M), float), standard_humidity()
    return kelvin[known].mean(axis=0), humidity[known].mean(axis=0)


def _filled(
    levels: Float[np.ndarray, "lat lon levels"], above: Float[np.ndarray, " levels"]
) -> Float[np.ndarray, "lat lon levels"]:
    known = np.isfinite(levels)
    some = np.any(known, axis=-1, keepdims=True)[..., 0]
    first = np.where(some, np.argmax(known, axis=-1), levels.shape[-1])
    lowest = np.take_along_axis(
        levels, np.minimum(first, levels.shape[-1] - 1)[..., None], axis=-1
    )
    below = np.arange(levels.shape[-1]) < first[..., None]
    filled = np.where(below, lowest, levels)
    filled = np.where(np.isfinite(filled), filled, above)
    return np.where(some[..., None], filled, np.nan)
