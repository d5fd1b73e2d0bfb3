"""What a weather analysis gives a scene: winds, temperatures, and where clouds are."""

import functools as ft
from dataclasses import dataclass, replace
from datetime import datetime

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from cloudjax import (
    Conditions,
    LatLonGrid,
    Scene,
    TemperatureProfile,
    cloud_classes,
    cloud_fraction,
)
from cloudjax.air.gases import LEVELS_M
from cloudjax.geometry.geodesy import MEAN_RADIUS_M
from cloudjax.weather.advection import DisplacementMap, Wind, displacement_map
from cloudjax_data import WeatherCube, WeatherSeries, check_altitude
from cloudjax_fit.targets import Target

from .air_profile import AirProfile


# Between the 2 and 20 hours that the paper stretches its clouds for.
DISPLACEMENT_HOURS = 6.0


@dataclass(frozen=True, eq=False)
class Analysis:
    """A weather analysis, ready for a scene.

    **Fields:** `cube`: the fields. `hours`: how long the wind has drawn the textures.
    """

    cube: WeatherCube
    hours: float = DISPLACEMENT_HOURS

    def displacements(self, scene: Scene) -> list[DisplacementMap | None]:
        """For each layer the map of the wind at its sampling altitude.

        None for a regional analysis: the air of a few hours ago is outside of it.
        """
        if not self.cube.is_global:
            return [None] * len(scene.layers)
        return list(_displacements(self, tuple(layer.name for layer in scene.layers)))

    def air(
        self, target: Target
    ) -> tuple[TemperatureProfile, Float[np.ndarray, " levels"]]:
        """Mean temperature and specific humidity over a target."""
        φ, λ = np.meshgrid(target.latitude_deg, target.longitude_deg, indexing="ij")
        kelvin, humidity = AirProfile(self._regular).mean(φ.ravel(), λ.ravel())
        levels = jnp.asarray(LEVELS_M, float)
        profile = TemperatureProfile(
            levels, jnp.asarray(kelvin, float), jnp.asarray(0.0)
        )
        return profile, humidity

    def fractions(self, conditions: Conditions) -> Float[np.ndarray, "lat lon"]:
        """Cloud fraction of a class by the decision of the paper's Table 1.

        **Raises:** `DataError` where the analysis does not reach that high.
        """
        altitude_m = float(conditions.sampling_altitude_m)
        check_altitude(self.cube, altitude_m)
        return fractions_at(self._regular.at_altitude(altitude_m), conditions)

    def masked(self, target: Target) -> Target:
        """The target with the analysis's clouds in place of those of the imagery."""
        classes = cloud_classes()
        φ, λ = np.meshgrid(target.latitude_deg, target.longitude_deg, indexing="ij")
        fractions = {}
        for name in target.fractions:
            field = np.nan_to_num(self.fractions(classes[name].conditions))
            fractions[name] = self._grid().sample(field[..., None], φ, λ)[..., 0]
        return replace(target, fractions=fractions)

    @property
    def _regular(self) -> WeatherCube:
        return self.cube.regular(0.25)

    def _grid(self) -> LatLonGrid:
        data = self._regular.data
        return LatLonGrid.from_axes(
            data["latitude"].to_numpy(), data["longitude"].to_numpy()
        )


@ft.lru_cache(maxsize=2)
def _displacements(
    analysis: Analysis, names: tuple[str, ...]
) -> tuple[DisplacementMap, ...]:
    """Kept, for a fit asks for the same maps for its rays and for its images."""
    classes, series = cloud_classes(), WeatherSeries.of([analysis.cube])
    altitudes = (float(classes[n].conditions.sampling_altitude_m) for n in names)
    return tuple(
        displacement_map(
            wind_at(series, altitude_m, analysis.cube.valid_time),
            hours=analysis.hours,
            resolution_deg=1.0,
        )
        for altitude_m in altitudes
    )


def fractions_at(
    level, conditions: Conditions, omega_sign: float = -1.0
) -> Float[np.ndarray, "lat lon"]:
    """Cloud fraction of a class from the weather at its altitude; NaN under ground."""
    humidity, temperature, omega = (
        jnp.asarray(level[name].to_numpy(), float) for name in ("r", "t", "w")
    )
    fraction = cloud_fraction(
        conditions,
        jnp.clip(humidity / 100, 0, 1),
        temperature,
        omega,
        omega_sign=omega_sign,
    )
    return np.where(np.isnan(humidity), np.nan, np.asarray(fraction, float))


def wind_at(series: WeatherSeries, altitude_m: float, origin: datetime) -> Wind:
    """The wind at an altitude, on a clock that starts at a time."""
    # Where the level is within a mountain, the air does not move.
    eastward, northward = (np.nan_to_num(w) for w in series.winds(altitude_m))
    data = series.cubes[0].data
    return Wind(
        eastward,
        northward,
        data["latitude"].to_numpy(),
        data["longitude"].to_numpy(),
        time_s=series.seconds_from(origin),
        radius_m=MEAN_RADIUS_M + altitude_m,
    )
