"""A scene of clouds in columns, of a weather model or seen by a satellite.

Other scenes draw fractal clouds where weather or imagery lets them stand.
"""

import functools as ft
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from types import MappingProxyType
from typing import Any

import numpy as np
from jaxtyping import Float

from cloudjax import (
    Air,
    Band,
    EmissiveBands,
    LatLonGrid,
    Layer,
    ProfileGrid,
    ReflectiveBands,
    Scene,
)
from cloudjax.air.atmosphere import temperature_k
from cloudjax.air.gases import LEVELS_M, standard_humidity
from cloudjax.clouds.columns import ColumnCloud
from cloudjax.clouds.detailed_columns import width_for_detail_m
from cloudjax.light.bands import sunlit_and_thermal
from cloudjax.march.column_layer import column_layer
from cloudjax_data import DataError, earth_sun_distance_au

from .lights import Light, light_named
from .model_columns import CloudColumns
from .surface import Surface, wind_at_10_m


# Of the map of temperatures; more places than a model's air has structure.
_MOST_PLACES = 64
# Above the model's top the standard air follows, as much warmer as the top is, fading.
_FADING_M = 5e3


@dataclass(frozen=True, eq=False)
class ModelWorld:
    """A `ModelWorld` is one time of clouds in columns, ready for any sensor.

    **Fields:**

    - `columns`: of a weather model, or seen by a satellite.
    - `steps`: through the shell of water and through that of ice.
    - `light`: the strategy for sunlight, one of `lights.LIGHTS`.
    - `shadows`: steps towards the sun, 0 for no shadows.
    - `scattering`: whether cloud scatters thermal radiation; else it absorbs alone.
    - `detail_m`, `seed`: the shortest wave of fractal detail below the columns, and by
      which it is drawn; None for no detail.

    **Raises:** `DataError` where the columns have no cloud, for no steps, for shadows
    with another light than the physical one, and for detail coarser than the columns.
    """

    columns: CloudColumns
    steps: int = 24
    light: str = "physical"
    shadows: int = 0
    scattering: bool = True
    detail_m: float | None = None
    seed: int = 0

    def __post_init__(self):
        self.columns.require_cloud()
        if self.steps < 1:
            raise DataError(f"steps = {self.steps} is none: make it 1 or more.")
        # For its errors.
        self.strategy.shadows(self.shadows)
        if self.detail_m is not None:
            try:
                width_for_detail_m(self.columns.grid, self.detail_m)
            except ValueError as error:
                raise DataError(f"{', '.join(self.sources)}: {error}") from error

    @property
    def strategy(self) -> Light:
        """Give the strategy for light."""
        return light_named(self.light)

    @property
    def sources(self) -> tuple[str, ...]:
        """Give the names of the files that it is made of."""
        return tuple(self.columns.sources)

    @ft.cached_property
    def classes(self) -> Mapping[str, ColumnCloud]:
        """Give the clouds of each phase that has some."""
        columns = self.columns
        return MappingProxyType(
            {
                part.phase: ColumnCloud.of(
                    columns.grid,
                    columns.heights_m,
                    part.phase,
                    part.content_g_m3,
                    part.effective_radius_um,
                    columns.cloud_fraction,
                )
                for part in columns.condensate
                if part.content_g_m3.max() > 0
            }
        )

    def winds(self, time: datetime) -> Mapping:
        """Give no winds: a model has moved its clouds itself."""
        del time
        return {}

    def scene(
        self,
        bands: Sequence[Band],
        time: datetime,
        winds: Any = None,
        *,
        day: bool = True,
        ready: bool = True,
    ) -> Scene:
        """Build the scene for the bands of a sensor.

        **Arguments:**

        - `time`: of the sun.
        - `day`: whether bands that emit see the sun as well.
        - `ready`: as of `column_layer`; not for derivatives by water and radius.
        """
        del winds
        light = self.strategy
        sunlit, emissive = sunlit_and_thermal(bands, day=day)
        layers = self._layers(sunlit, emissive, ready)
        return Scene(
            layers=layers,
            reflective=ReflectiveBands.of(sunlit, earth_sun_distance_au(time)),
            emissive=EmissiveBands.of(emissive),
            reflection=light.reflection(),
            emission=light.emission_in(emissive) if self.scattering else None,
            air=Air.of_bands([band.number for band in bands], profiles=self.profiles),
            shadows=light.shadows(self.shadows),
            ground=self.surface,
        )

    def _layers(self, sunlit, emissive, ready: bool) -> tuple[Layer, ...]:
        return tuple(
            column_layer(
                cloud,
                sunlit=[band.number for band in sunlit],
                thermal=[band.number for band in emissive],
                steps=self.steps,
                extinction_share=self.strategy.share,
                ready=ready,
                detail_m=self.detail_m,
                seed=self.seed,
            )
            for cloud in self.classes.values()
        )

    @ft.cached_property
    def surface(self) -> Surface:
        """Give the ground, as warm as the lowest air, in its wind; beyond the model as
        at its edge.
        """
        air = self.columns.air
        if air is None:
            return Surface.of()
        nearest = self._nearest
        height = self.columns.ground_m[nearest]
        winds, wind = self.columns.winds_m_s, None
        if winds is not None:
            above = (air.heights_m[0] - self.columns.ground_m)[nearest]
            wind = wind_at_10_m(np.hypot(*winds[:2])[0][nearest], above)
        kelvin = air.temperature_k[0][nearest]
        return Surface.as_warm_as(kelvin, height, self._places, wind)

    @ft.cached_property
    def profiles(self) -> ProfileGrid | None:
        """Give the air of the columns, above its top the US standard atmosphere; None
        for the latter alone.
        """
        air = self.columns.air
        if air is None:
            return None
        row, column = self._nearest
        heights, kelvin, humidity = (
            field[:, row, column].reshape(len(field), -1).T
            for field in (air.heights_m, air.temperature_k, air.specific_humidity)
        )
        shape = (*row.shape, len(LEVELS_M))
        warm = _extended_all(
            heights, kelvin, np.asarray(temperature_k(LEVELS_M), float)
        )
        moist = _extended_all(heights, humidity, standard_humidity())
        return ProfileGrid(
            warm.reshape(shape).astype(np.float32),
            np.maximum(moist, 0).reshape(shape).astype(np.float32),
            self._places,
        )

    @ft.cached_property
    def _places(self) -> LatLonGrid:
        """Latitudes and longitudes over the model, some as far apart as its columns."""
        grid = self.columns.grid
        latitude, longitude = grid.places(*grid.mesh())
        middle = longitude[longitude.shape[0] // 2, longitude.shape[1] // 2]
        longitude = middle + (longitude - middle + 180) % 360 - 180
        axes = [
            np.linspace(a.min(), a.max(), int(np.clip(n, 2, _MOST_PLACES)))
            for a, n in zip((latitude, longitude), grid.shape, strict=True)
        ]
        return LatLonGrid.from_axes(*axes)

    @ft.cached_property
    def _nearest(self) -> tuple[np.ndarray, np.ndarray]:
        """Row and column next to each of the places."""
        places, grid = self._places, self.columns.grid
        axes = places.latitude.values, places.longitude.values
        index = grid.index(*np.meshgrid(*axes, indexing="ij"))
        row, column = (
            np.clip(np.rint(x), 0, n - 1).astype(int)
            for x, n in zip(index, grid.shape, strict=True)
        )
        return row, column


def _extended_all(heights_m, values, above) -> Float[np.ndarray, "places standard"]:
    pairs = zip(heights_m, values, strict=True)
    return np.array([_extended(*pair, above) for pair in pairs])


def _extended(
    height_m: Float[np.ndarray, " levels"],
    values: Float[np.ndarray, " levels"],
    above: Float[np.ndarray, " standard"],
) -> Float[np.ndarray, " standard"]:
    """Values at the standard levels, held below the first one."""
    top = height_m[-1]
    beyond = np.interp(top, LEVELS_M, above)
    faded = np.exp(-np.maximum(LEVELS_M - top, 0) / _FADING_M)
    further = above + (values[-1] - beyond) * faded
    return np.where(top < LEVELS_M, further, np.interp(LEVELS_M, height_m, values))
