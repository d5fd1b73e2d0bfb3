"""A scene made of weather alone: all classes of cloud, anywhere on Earth.

Where there is imagery, the scene comes from it (`imagery_scene.py`). Here masks, winds
and temperatures come from weather analyses, the ground from a table.
"""

import functools as ft
import itertools as it
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path

import numpy as np
from jaxtyping import Float

from cloudjax import (
    AbstractMask,
    Air,
    Band,
    CloudClass,
    EmissiveBands,
    FractalCloud,
    LatLonGrid,
    Layer,
    ProfileGrid,
    ReflectiveBands,
    Scene,
    Shell,
    StandardAtmosphere,
    TemperatureGrid,
    class_layer,
    in_generations,
    load_classes,
    weather_classes,
)
from cloudjax.light.bands import sunlit_and_thermal
from cloudjax_data import (
    DataError,
    WeatherSeries,
    check_altitude,
    earth_sun_distance_au,
    read_weather,
)

from .air_profile import profiles_of
from .data_errors import data_errors
from .lights import Light, light_named
from .surface import Surface
from .weather_decision import (
    AllEvidence,
    CoverDecision,
    Fractions,
    MaskOf,
    decision_named,
)
from .winds import AirMotion, Winds


# Steps grow with the root of a shell's depth, a rule of thumb: what marches by it err
# by is in docs/accuracy/speed.md. Shells of so much air have all that are asked. Others
# have one of few parts, for layers of one number are compiled faster, and no less than
# so many.
_DEEP_M, _PARTS, _FEWEST_STEPS = 12e3, (1 / 3, 1 / 2, 1.0), 6
# Levels of the temperature field, linear in between.
_LEVELS_M = np.arange(0.0, 16e3, 500.0)


@dataclass(frozen=True, eq=False)
class World:
    """A `World` is weather and what is made of it.

    **Fields:**

    - `series`: analyses of one time or several, over the whole globe.
    - `classes`: of cloud, by name.
    - `decision`: on where they are: all that the analyses tell, or Table 1.
    - `seed`: of all textures.
    - `steps`: through the deepest shells, see `steps_through`; `nodes`: sub-pixel
      structures that radiances are averaged over.
    - `omega_sign`: of the vertical wind, see `cloudjax.cloud_fraction`.
    - `light`: the strategy for sunlight, one of `lights.LIGHTS`.
    - `air`: whether gases and Rayleigh scattering count.
    - `shadows`: steps towards the sun, 0 for no shadows.
    - `scattering`: whether cloud scatters thermal radiation; else it absorbs alone.

    **Raises:** `DataError` for regional weather, for air comes from outside of it;
    without a class; for a negative seed or no steps; for shadows with another light
    than the physical one.
    """

    series: WeatherSeries
    classes: Mapping[str, CloudClass] = field(default_factory=weather_classes)
    decision: CoverDecision = field(default_factory=AllEvidence)
    seed: int = 0
    steps: int = 24
    omega_sign: float = -1.0
    light: str = "physical"
    air: bool = True
    shadows: int = 0
    nodes: int = 5
    scattering: bool = True

    def __post_init__(self):
        cube = self.series.cubes[0]
        if not cube.is_global:
            raise DataError(
                f"{cube.path} covers a region only: get the global analysis, for the "
                "wind brings clouds from outside."
            )
        for each in self.series.cubes:
            unknown = 1 - each.known_columns.mean()
            if unknown > 0:
                raise DataError(
                    f"{each.path} has no values at {unknown:.2%} of its places: get an "
                    "analysis that has them everywhere."
                )
        if not self.classes:
            raise DataError("There is no class of cloud: give one at least.")
        if self.seed < 0:
            raise DataError(f"seed = {self.seed} is negative: make it 0 or more.")
        if self.steps < 1:
            raise DataError(f"steps = {self.steps} is none: make it 1 or more.")
        if self.nodes < 1:
            raise DataError(f"nodes = {self.nodes} is none: make it 1 or more.")
        # For its errors.
        self.strategy.shadows(self.shadows)

    @property
    def strategy(self) -> Light:
        """Give the strategy for light."""
        return light_named(self.light)

    @property
    def sources(self) -> tuple[str, ...]:
        """Give the names of the files that it is made of."""
        return tuple(cube.path.name for cube in self.series.cubes)

    def scene(
        self,
        bands: Sequence[Band],
        time: datetime,
        winds: Winds | None = None,
        *,
        day: bool = True,
    ) -> Scene:
        """Build the scene of one time, with all classes, for the bands of a sensor.

        **Arguments:**

        - `winds`: how they have drawn the clouds, where that is at hand.
        - `day`: whether bands that emit see the sun as well.
        """
        light = self.strategy
        sunlit, emissive = sunlit_and_thermal(bands, day=day)
        numbers = [band.number for band in bands]
        return Scene(
            layers=self._layers(
                self.winds(time) if winds is None else winds, sunlit, emissive
            ),
            reflective=ReflectiveBands.of(sunlit, earth_sun_distance_au(time)),
            emissive=EmissiveBands.of(emissive),
            reflection=light.reflection(),
            emission=light.emission_in(emissive) if self.scattering else None,
            temperature=StandardAtmosphere() if self.air else self.temperature,
            air=Air.of_bands(numbers, profiles=self.profiles) if self.air else None,
            shadows=light.shadows(self.shadows),
            ground=self.surface(time),
        )

    def _layers(
        self,
        winds: Winds,
        sunlit: Sequence[Band],
        emissive: Sequence[Band],
    ) -> tuple[Layer, ...]:
        layers = []
        for i, (name, one) in enumerate(self.classes.items()):
            layer = class_layer(
                one,
                sunlit=[band.number for band in sunlit],
                thermal=[band.number for band in emissive],
                seed=self.seed + 100 * i,
                steps=steps_through(one.marched, self.steps),
                nodes=self.nodes,
                extinction_share=self.strategy.share,
                mask=self._mask(name, one, winds),
            )
            assert isinstance(layer.cloud, FractalCloud)
            cloud = in_generations(layer.cloud, winds.generations(one))
            layers.append(replace(layer, cloud=cloud))
        return tuple(layers)

    def _mask(self, name: str, one: CloudClass, winds: Winds) -> AbstractMask:
        held = [of_classes[name] for of_classes in self._held]
        altitude = float(one.conditions.sampling_altitude_m)
        carried = winds.carried(held, altitude, one.mask_displacement_hours)
        return self._masks[name](carried)

    def winds(self, time: datetime) -> Winds:
        """Find how the winds have moved the clouds of one time."""
        return self._motion.still(time)

    def frames(
        self, start: datetime, count: int, minutes: float
    ) -> Iterator[tuple[datetime, Winds]]:
        """Give times and winds of a film, or of a still where there is one frame."""
        if count == 1:
            return iter([(start, self.winds(start))])
        return self._motion.frames(start, count, minutes)

    @property
    def _motion(self) -> AirMotion:
        return AirMotion(self.series, self.classes.values())

    @ft.cached_property
    def fractions(self) -> tuple[Fractions, ...]:
        """Give the cloud fraction of each class in each analysis, NaN under ground."""
        return tuple(
            self.decision.fractions(cube, self.classes, omega_sign=self.omega_sign)
            for cube in self.series.cubes
        )

    @ft.cached_property
    def _held(self) -> tuple[dict[str, AbstractMask], ...]:
        axes = _axes(self.series.cubes[0].data)
        return tuple(
            {name: self.decision.held(one, axes) for name, one in fractions.items()}
            for fractions in self.fractions
        )

    @ft.cached_property
    def _masks(self) -> dict[str, MaskOf]:
        return {
            name: self.decision.mask(one, steps_through(one.marched, self.steps))
            for name, one in self.classes.items()
        }

    def surface(self, time: datetime) -> Surface:
        """Return the ground as warm as in the analyses next to a time, linear between
        two.
        """
        (i, _), *later = self.series.weights(time)
        found = self._surfaces[i]
        for j, weight in later:
            found = found.towards(self._surfaces[j], weight)
        return found

    @ft.cached_property
    def _surfaces(self) -> tuple[Surface, ...]:
        return tuple(Surface.of(cube) for cube in self.series.cubes)

    @ft.cached_property
    def profiles(self) -> ProfileGrid:
        """Give the air of the first analysis."""
        return profiles_of(self.series.cubes[0])

    @ft.cached_property
    def temperature(self) -> TemperatureGrid:
        """Give the temperature of the first analysis, for scenes without air."""
        cube = self.series.cubes[0]
        levels = [cube.at_altitude(float(z))["t"].to_numpy() for z in _LEVELS_M]
        nodes = _filled(np.stack(levels, axis=-1))
        grid = LatLonGrid.from_axes(*_axes(cube.data))
        return TemperatureGrid(nodes, grid, float(_LEVELS_M[1]))


def steps_through(shell: Shell, steps: int) -> int:
    """Return the steps of the march through a shell, so many through the deepest."""
    share = math.sqrt(shell.depth_m / _DEEP_M)
    part = min(_PARTS, key=lambda part: abs(math.log(part / share)))
    return max(math.ceil(steps * part), min(steps, _FEWEST_STEPS))


def open_world(
    weather: Sequence[str | os.PathLike[str]],
    classes: str | Path | None = None,
    *,
    decision: str | CoverDecision = "evidence",
    **settings,
) -> World:
    """Make a world from files.

    **Arguments:**

    - `weather`: GRIB files of one grid.
    - `classes`: a TOML file; by default those of the decision.
    - `decision`: on where clouds are, or its name, one of `DECISIONS`.
    - `settings`: other fields of `World`.

    **Raises:** `DataError` for any file that does not serve.
    """
    if isinstance(decision, str):
        decision = decision_named(decision)
    series = WeatherSeries.of([read_weather(file) for file in weather])
    with data_errors():
        known = decision.classes() if classes is None else load_classes(classes)
    for cube, one in it.product(series.cubes, known.values()):
        check_altitude(cube, float(one.conditions.sampling_altitude_m))
    return World(series, known, decision, **settings)


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
