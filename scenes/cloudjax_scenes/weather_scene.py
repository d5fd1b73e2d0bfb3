"""A scene made of weather alone: all classes of cloud, anywhere on Earth.

Where there is imagery, the scene comes from it (`imagery_scene.py`). Here masks, winds
and temperatures come from weather analyses, the ground from a table.
"""

import functools as ft
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from cloudjax import (
    Band,
    BandRadiances,
    CloudClass,
    Conditions,
    DisplacementMap,
    EmissiveBands,
    LatLonGrid,
    MaskGrid,
    Rays,
    ReflectiveBands,
    Scene,
    StandardAtmosphere,
    Weather,
    class_layer,
    cloud_classes,
    displacement_map,
    load_classes,
    propagate,
)
from cloudjax.air.clear_air import Air
from cloudjax.geometry.geodesy import up
from cloudjax_data import (
    DataError,
    WeatherSeries,
    check_altitude,
    read_weather,
    sun_direction,
)

from .air_profile import AirProfile
from .clear_sky import through_air
from .data_errors import data_errors
from .lights import Light, light_named
from .surface import Surface
from .weather_analysis import MAP_STEP_DEG, fractions_at, wind_at


# As that of a fresh map of 20 hours.
_STEP_MINUTES = 30.0
# Levels of the temperature field, linear in between.
_LEVELS_M = np.arange(0.0, 16e3, 500.0)


@dataclass(frozen=True, eq=False)
class World:
    """Weather and what is made of it.

    **Fields:**

    - `series`: analyses of one time or several, over the whole globe.
    - `classes`: of cloud, by name.
    - `seed`: of all textures.
    - `steps`: through each shell.
    - `omega_sign`: of the vertical wind, see `cloudjax.cloud_fraction`.
    - `light`: the strategy for sunlight, one of `lights.LIGHTS`.
    - `air`: whether gases and Rayleigh scattering count.
    - `shadows`: steps towards the sun, 0 for no shadows.

    **Raises:** `DataError` for regional weather, for air comes from outside of it;
    without a class; for a negative seed or no steps; for shadows with another light
    than the physical one.
    """

    series: WeatherSeries
    classes: Mapping[str, CloudClass] = field(default_factory=cloud_classes)
    seed: int = 0
    steps: int = 24
    omega_sign: float = -1.0
    light: str = "physical"
    air: bool = True
    shadows: int = 0

    def __post_init__(self):
        cube = self.series.cubes[0]
        if not cube.is_global:
            raise DataError(
                f"{cube.path} covers a region only: get the global analysis, for the "
                "wind brings clouds from outside."
            )
        if not self.classes:
            raise DataError("There is no class of cloud: give one at least.")
        if self.seed < 0:
            raise DataError(f"seed = {self.seed} is negative: make it 0 or more.")
        if self.steps < 1:
            raise DataError(f"steps = {self.steps} is none: make it 1 or more.")
        # For its errors.
        self.strategy.shadows(self.shadows)

    @property
    def strategy(self) -> Light:
        """The strategy for light."""
        return light_named(self.light)

    def require_resolution(self, voxels: int) -> None:
        """Raise `DataError` if so many per axis are too few for a texture."""
        needed, name = max(
            (2 * texture.fractal.finest_cells, one.name)
            for one in self.classes.values()
            for texture in one.textures
        )
        if voxels < needed:
            raise DataError(
                f"resolution = {voxels} is too coarse for the textures of {name}, "
                f"which need two voxels per cell: make it {needed} or more."
            )

    def scene(
        self, bands: Sequence[Band], distance_au: float = 1.0, *, day: bool = True
    ) -> Scene:
        """All classes, for the bands of a sensor.

        **Arguments:** `day`: whether bands that emit see the sun as well.
        """
        light = self.strategy
        sunlit = [b for b in bands if b.reflective or (day and b.sunlit)]
        emissive = [band for band in bands if not band.reflective]
        layers = tuple(
            class_layer(
                one,
                sunlit=[band.number for band in sunlit],
                thermal=[band.number for band in emissive],
                seed=self.seed + 100 * i,
                steps=self.steps,
                extinction_share=light.share,
            )
            for i, one in enumerate(self.classes.values())
        )
        return Scene(
            layers=layers,
            reflective=ReflectiveBands.of(sunlit, distance_au),
            emissive=EmissiveBands.of(emissive),
            reflection=light.reflection(),
            emission=light.emission() if light.emission and emissive else None,
            temperature=StandardAtmosphere(),
            air=Air.of_bands([band.number for band in bands]) if self.air else None,
            shadows=light.shadows(self.shadows),
        )

    def weather(self, time: datetime) -> Weather:
        """Masks, winds and temperatures of one time."""
        maps = {
            key: self._map(*key, time=time)
            for one in self.classes.values()
            for key in _winds(one)
        }
        return self._weather(time, maps)

    def frames(self, start: datetime, count: int, minutes: float):
        """Times and weather of an animation, each map carried on from the one before.

        Yields `(time, Weather)`.
        """
        keys = {key for one in self.classes.values() for key in _winds(one)}
        maps = {key: self._map(*key, time=start) for key in keys}
        for i in range(count):
            time = start + timedelta(minutes=i * minutes)
            if i > 0:
                maps = {
                    (altitude, hours): propagate(
                        earlier,
                        wind_at(self.series, altitude, start),
                        duration_s=60 * minutes,
                        steps=math.ceil(minutes / _STEP_MINUTES),
                    )
                    for (altitude, hours), earlier in maps.items()
                }
            yield time, self._weather(time, maps)

    def fractions(
        self, conditions: Conditions, time: datetime
    ) -> Float[np.ndarray, "lat lon"]:
        """Cloud fraction of a class by the decision of Table 1."""
        altitude = float(conditions.sampling_altitude_m)
        return fractions_at(
            self.series.at_altitude(altitude, time), conditions, self.omega_sign
        )

    def background(self, scene: Scene, rays: Rays, time: datetime) -> BandRadiances:
        """What is seen without cloud: the ground, through the air of the scene.

        Zero where a ray misses the Earth.
        """
        ground, hit = rays.ground()
        φ, λ = ground.latitude_deg, ground.longitude_deg
        sun = sun_direction(time)
        reflective = emissive = None
        if scene.reflective is not None:
            height = np.maximum((up(φ, λ) * sun).sum(-1), 0)
            albedo = self.surface.reflectance(scene.reflective.numbers, φ, λ)
            reflective = jnp.asarray(albedo * height, float)
        if scene.emissive is not None:
            kelvin = jnp.asarray(self.surface.temperature_k(φ, λ), float)
            emissivity = self.surface.emissivity(scene.emissive.numbers, φ, λ)
            emissive = jnp.asarray(emissivity, float) * scene.emissive.planck(kelvin)
        bare = BandRadiances(reflective, emissive)
        if scene.air is not None:
            column = scene.air.navigate(rays, sun, scene.temperature, self.profile)
            altitude = jnp.asarray(self.surface.altitude_m(φ, λ), float)
            bare = through_air(scene, column, bare, altitude)
        reflective, emissive = (
            None if seen is None else jnp.where(hit, seen, 0)
            for seen in (bare.reflective, bare.emissive)
        )
        if scene.reflective is not None and reflective is not None:
            reflective = scene.reflective.radiance(reflective)
        return BandRadiances(reflective, emissive)

    @ft.cached_property
    def surface(self) -> Surface:
        return Surface(self.series.cubes[0])

    @ft.cached_property
    def profile(self) -> AirProfile:
        """The air of the first analysis."""
        return AirProfile(self.series.cubes[0])

    def temperature_k(self, latitude_deg, longitude_deg, altitude_m):
        """Of the air of the first analysis, [points] each, numpy."""
        nodes, grid = self._temperatures
        level = np.clip(altitude_m / _LEVELS_M[1], 0, len(_LEVELS_M) - 1)
        below = np.minimum(level.astype(int), len(_LEVELS_M) - 2)
        corners = grid.corners(latitude_deg, longitude_deg)
        low, high = (
            sum(weight * nodes[index, z] for index, weight in corners)
            for z in (below, below + 1)
        )
        return low + (level - below) * (high - low)

    @ft.cached_property
    def _temperatures(self):
        cube = self.series.cubes[0]
        levels = [cube.at_altitude(float(z))["t"].to_numpy() for z in _LEVELS_M]
        nodes = _filled(np.stack(levels, axis=-1)).reshape(-1, len(_LEVELS_M))
        return nodes, LatLonGrid.from_axes(*_axes(cube.data))

    def _weather(self, time, maps: Mapping) -> Weather:
        masks, displacements = [], []
        axes = _axes(self.series.cubes[0].data)
        for one in self.classes.values():
            mask = MaskGrid.from_fraction(self.fractions(one.conditions, time), *axes)
            altitude = float(one.conditions.sampling_altitude_m)
            drawn = maps.get((altitude, one.mask_displacement_hours))
            masks.append(mask if drawn is None else DisplacedMask(mask, drawn))
            displacements.append(
                [maps.get((altitude, t.displacement_hours)) for t in one.textures]
            )
        if self.air:
            return Weather(masks, displacements, profile=self.profile)
        return Weather(masks, displacements, self.temperature_k)

    def _map(self, altitude_m: float, hours: float, *, time: datetime):
        return displacement_map(
            wind_at(self.series, altitude_m, time),
            hours=hours,
            resolution_deg=MAP_STEP_DEG,
        )


def open_world(
    weather: Sequence[str | os.PathLike[str]],
    classes: str | Path | None = None,
    **settings,
) -> World:
    """A world from files.

    **Arguments:**

    - `weather`: GRIB files of one grid.
    - `classes`: a TOML file; by default those of Table 1.
    - `settings`: other fields of `World`.

    **Raises:** `DataError` for any file that does not serve.
    """
    series = WeatherSeries.of([read_weather(file) for file in weather])
    with data_errors():
        known = cloud_classes() if classes is None else load_classes(classes)
    for one in known.values():
        check_altitude(series.cubes[0], float(one.conditions.sampling_altitude_m))
    return World(series, known, **settings)


@dataclass(frozen=True, eq=False)
class DisplacedMask:
    """A weather mask that the wind has drawn out, to be called as the mask itself."""

    mask: MaskGrid
    displacement: DisplacementMap

    def __call__(self, latitude_deg, longitude_deg):
        source = self.displacement.upwind(up(latitude_deg, longitude_deg))
        φ = np.degrees(np.arcsin(np.clip(source[..., 2], -1, 1)))
        return self.mask(φ, np.degrees(np.arctan2(source[..., 1], source[..., 0])))


def _winds(one: CloudClass) -> set[tuple[float, float]]:
    """Altitudes and hours of the displacement maps that a class needs."""
    altitude = float(one.conditions.sampling_altitude_m)
    hours = {t.displacement_hours for t in one.textures} | {one.mask_displacement_hours}
    return {(altitude, h) for h in hours if h > 0}


def _axes(data) -> tuple[np.ndarray, np.ndarray]:
    return data["latitude"].to_numpy(), data["longitude"].to_numpy()


def _filled(levels: Float[np.ndarray, "lat lon z"]) -> Float[np.ndarray, "lat lon z"]:
    """Temperatures under the ground: those of the first level above it."""
    known = np.isfinite(levels)
    first = np.argmax(known, axis=-1)
    index = np.maximum(np.arange(levels.shape[-1]), first[..., None])
    # Above the highest level, that one's.
    last = levels.shape[-1] - 1 - np.argmax(known[..., ::-1], axis=-1)
    return np.take_along_axis(levels, np.minimum(index, last[..., None]), axis=-1)
