"""What a weather analysis gives a scene: winds, temperatures, and where clouds are."""

import functools as ft
from dataclasses import dataclass, replace

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
from cloudjax.advection import DisplacementMap, Wind, displacement_map
from cloudjax_data import WeatherCube, check_altitude

from .target import Target


EARTH_RADIUS_M = 6371e3
# Between the 2 and 20 hours that the paper stretches its clouds for.
DISPLACEMENT_HOURS = 6.0
# Altitudes of the temperature profile.
_PROFILE_M = np.arange(500.0, 16e3, 500.0)


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

    def temperature(self, target: Target) -> TemperatureProfile:
        """The mean profile over a target."""
        grid = self._grid()
        φ, λ = np.meshgrid(target.latitude_deg, target.longitude_deg, indexing="ij")
        means = []
        for altitude in _PROFILE_M:
            field = self._regular.at_altitude(altitude)["t"].to_numpy()
            over = grid.sample(field[..., None], φ, λ)
            means.append(
                over[np.isfinite(over)].mean() if np.isfinite(over).any() else np.nan
            )
        known = np.isfinite(means)
        return TemperatureProfile(
            jnp.asarray(_PROFILE_M[known], float),
            jnp.asarray(np.array(means)[known], float),
            jnp.asarray(0.0),
        )

    def fractions(self, conditions: Conditions) -> Float[np.ndarray, "lat lon"]:
        """Cloud fraction of a class by the decision of the paper's Table 1.

        **Raises:** `DataError` where the analysis does not reach that high.
        """
        altitude_m = float(conditions.sampling_altitude_m)
        check_altitude(self.cube, altitude_m)
        level = self._regular.at_altitude(altitude_m)
        humidity, temperature, omega = (
            jnp.asarray(np.nan_to_num(level[name].to_numpy(), nan=fallback), float)
            for name, fallback in (("r", 0.0), ("t", 273.15), ("w", 0.0))
        )
        fraction = cloud_fraction(
            conditions, jnp.clip(humidity / 100, 0, 1), temperature, omega
        )
        missing = np.isnan(level["r"].to_numpy())
        return np.where(missing, np.nan, np.asarray(fraction, float))

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
    classes = cloud_classes()
    return tuple(
        displacement_map(
            _wind(analysis.cube, float(classes[name].conditions.sampling_altitude_m)),
            hours=analysis.hours,
            resolution_deg=1.0,
        )
        for name in names
    )


def _wind(cube: WeatherCube, altitude_m: float) -> Wind:
    level = cube.at_altitude(float(altitude_m))
    # Where the level is within a mountain, the air does not move.
    eastward, northward = (
        np.nan_to_num(level[name].to_numpy())[None] for name in ("u", "v")
    )
    return Wind(
        eastward,
        northward,
        level["latitude"].to_numpy(),
        level["longitude"].to_numpy(),
        radius_m=EARTH_RADIUS_M + float(altitude_m),
    )
