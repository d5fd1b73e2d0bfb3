"""What a weather analysis gives a scene: winds, temperatures, and where clouds are."""

import functools as ft
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from cloudjax import (
    CloudClass,
    Conditions,
    LatLonGrid,
    TemperatureProfile,
)
from cloudjax.air.gases import LEVELS_M
from cloudjax.geometry.geodesy import MEAN_RADIUS_M
from cloudjax.weather.advection import DisplacementMap, Wind, displacement_map
from cloudjax_data import WeatherCube, WeatherSeries, check_altitude

from .air_profile import mean_profile, profiles_of
from .imagery import Imagery
from .weather_cover import held_places, held_share
from .weather_decision import fractions_at


MAP_STEP_DEG = 1.0


@dataclass(frozen=True, eq=False)
class Analysis:
    """An `Analysis` is a weather analysis, ready for a scene.

    **Fields:**

    - `cube`: the fields.
    - `passed_over`: sentences on files that were at hand and do not serve.
    """

    cube: WeatherCube
    passed_over: tuple[str, ...] = ()

    def notes(self, imagery: Imagery) -> list[str]:
        """Say what of a scene the analysis leaves open, in sentences."""
        name, share = self.cube.path.name, held_share(self.cube, imagery.grid)
        said = [*self.cube.notes, *(f"Left alone: {why}" for why in self.passed_over)]
        if share < 1:
            said.append(
                f"{name} holds {share_in_words(share)} of the scene: the air is the "
                "mean of that part, and elsewhere clouds stand where the imagery has "
                "them."
            )
        if not self.cube.is_global:
            said.append(f"{name} is regional: its winds draw no clouds.")
        return said

    def displacements(
        self, classes: Sequence[CloudClass]
    ) -> list[list[DisplacementMap | None]]:
        """Find the maps of the wind for the textures of each class.

        None for a regional analysis: the air of a few hours ago is outside of it.
        """
        return [
            [self._map(one, t.displacement_hours) for t in one.textures]
            for one in classes
        ]

    def _map(self, one: CloudClass, hours: float) -> DisplacementMap | None:
        if not self.cube.is_global or hours == 0:
            return None
        return _displacement(self, float(one.conditions.sampling_altitude_m), hours)

    def air(
        self, imagery: Imagery
    ) -> tuple[TemperatureProfile, Float[np.ndarray, " levels"]]:
        """Find the mean temperature and specific humidity over imagery, where the
        analysis holds it.

        **Raises:** `DataError` if it holds nothing of it.
        """
        φ, λ, held = held_places(self.cube, imagery.grid)
        profiles = profiles_of(self._regular)
        kelvin, humidity = mean_profile(profiles, φ[held], λ[held])
        levels = jnp.asarray(LEVELS_M, float)
        profile = TemperatureProfile(
            levels, jnp.asarray(kelvin, float), jnp.asarray(0.0)
        )
        return profile, humidity

    def fractions(self, conditions: Conditions) -> Float[np.ndarray, "lat lon"]:
        """Return the cloud fraction of a class by the decision of the paper's Table 1.

        **Raises:** `DataError` where the analysis does not reach that high.
        """
        altitude_m = float(conditions.sampling_altitude_m)
        check_altitude(self.cube, altitude_m)
        return fractions_at(self._regular.at_altitude(altitude_m), conditions)

    def masked(self, imagery: Imagery, classes: Mapping[str, CloudClass]) -> Imagery:
        """Put the analysis's clouds in place of those of the imagery, where it holds
        the scene.

        **Arguments:** `classes`: whose conditions tell where.
        """
        φ, λ = np.meshgrid(imagery.latitude_deg, imagery.longitude_deg, indexing="ij")
        # Within mountains there is no cloud, beyond the analysis nobody knows.
        known = self._regular.known_columns.astype(float)
        given = self._grid().sample(known[..., None], φ, λ)[..., 0]
        held = self.cube.holds(φ, λ) & (given > 0.5)
        fractions = {}
        for name, seen in imagery.fractions.items():
            field = np.nan_to_num(self.fractions(classes[name].conditions))
            asked = self._grid().sample((known * field)[..., None], φ, λ)[..., 0]
            fractions[name] = np.where(held, asked / np.where(held, given, 1), seen)
        # What imagery tells of its clouds is not said of those of the weather.
        return replace(imagery, fractions=fractions, evidence={})

    @ft.cached_property
    def _regular(self) -> WeatherCube:
        return self.cube.regular(0.25)

    def _grid(self) -> LatLonGrid:
        data = self._regular.data
        return LatLonGrid.from_axes(
            data["latitude"].to_numpy(), data["longitude"].to_numpy()
        )


def share_in_words(share: float) -> str:
    """Return a share in per cent, never all unless it is."""
    return f"{np.floor(1000 * share) / 10:g} %"


@ft.lru_cache(maxsize=8)
def _displacement(
    analysis: Analysis, altitude_m: float, hours: float
) -> DisplacementMap:
    """Kept, for a fit asks for the same maps for its rays and for its images."""
    series = WeatherSeries.of([analysis.cube])
    return displacement_map(
        wind_at(series, altitude_m, analysis.cube.valid_time),
        hours=hours,
        resolution_deg=MAP_STEP_DEG,
    )


def wind_at(series: WeatherSeries, altitude_m: float, origin: datetime) -> Wind:
    """Return the wind at an altitude, on a clock that starts at a time."""
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
