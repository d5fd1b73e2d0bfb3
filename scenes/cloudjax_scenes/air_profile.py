"""Temperature and humidity of the air above any place, from a weather analysis."""

import functools as ft
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from cloudjax import LatLonGrid
from cloudjax.air.atmosphere import temperature_k
from cloudjax.air.gases import LEVELS_M, standard_humidity
from cloudjax_data import WeatherCube, specific_humidity


Profiles = tuple[Float[np.ndarray, "points levels"], Float[np.ndarray, "points levels"]]


@dataclass(frozen=True, eq=False)
class AirProfile:
    """Of an analysis on latitudes and longitudes, at `cloudjax.gases.LEVELS_M`.

    Below the ground the first air above it, above the highest level the US standard
    atmosphere; NaN outside of a map.
    """

    cube: WeatherCube

    def __call__(
        self,
        latitude_deg: Float[np.ndarray, " points"],
        longitude_deg: Float[np.ndarray, " points"],
    ) -> Profiles:
        """Temperature in kelvin and specific humidity, bilinear."""
        nodes, grid = self._nodes
        both = np.asarray(grid.sample(nodes, latitude_deg, longitude_deg))
        kelvin, humidity = np.split(both, 2, axis=-1)
        return kelvin, humidity

    def mean(
        self,
        latitude_deg: Float[np.ndarray, " points"],
        longitude_deg: Float[np.ndarray, " points"],
    ) -> tuple[Float[np.ndarray, " levels"], Float[np.ndarray, " levels"]]:
        """Over those of these places that the analysis covers."""
        kelvin, humidity = self(latitude_deg, longitude_deg)
        known = np.isfinite(kelvin).all(axis=-1)
        if not known.any():
            return np.asarray(temperature_k(LEVELS_M), float), standard_humidity()
        return kelvin[known].mean(axis=0), humidity[known].mean(axis=0)

    @ft.cached_property
    def _nodes(self) -> tuple[Float[np.ndarray, "lat lon both"], LatLonGrid]:
        data = self.cube.data
        humidity = specific_humidity(
            data["r"].to_numpy(),
            data["t"].to_numpy(),
            data["level"].to_numpy()[:, None, None],
        )
        kept = [name for name in ("gh", "t", "orog") if name in data]
        moist = data[kept].assign(q=(data["t"].dims, humidity))
        cube = replace(self.cube, data=moist)
        levels = [cube.at_altitude(float(z)) for z in LEVELS_M]
        fields = [
            _filled(np.stack([at[name].to_numpy() for at in levels], axis=-1), top)
            for name, top in (
                ("t", np.asarray(temperature_k(LEVELS_M))),
                ("q", standard_humidity()),
            )
        ]
        axes = (data[axis].to_numpy() for axis in ("latitude", "longitude"))
        both = np.concatenate(fields, axis=-1).astype(np.float32)
        return both, LatLonGrid.from_axes(*axes)


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
