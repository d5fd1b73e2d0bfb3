"""From a scene folder and the options of a run to what is fitted or rendered."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from cloudjax_data import (
    AbiScene,
    DataError,
    SceneFolder,
    check_time,
    open_folder,
    read_band,
    read_weather,
)
from cloudjax_scenes.cloud_rule import BRIGHT, COLD_K
from cloudjax_scenes.daylight import is_day, sun_heights_deg
from cloudjax_scenes.weather_analysis import Analysis

from .observation import observe
from .settings import Settings, cloud_rule, read_settings, scene_of, with_options
from .targets import Target


# Blue and near infrared tell cloud from land and sea, the window how high it is.
DAY_BANDS = (1, 3, 13)
# What two windows differ by tells thin from broken cloud.
NIGHT_BANDS = (13, 15)


@dataclass(frozen=True, eq=False)
class Run:
    """A scene, ready to be fitted or rendered.

    **Fields:**

    - `settings`: of the scene's `scene.toml` and of the options, checked.
    - `target`: the scene, reduced.
    - `analysis`: the weather of the hour, where the folder has it.
    - `observed`: radiances by band on the target's grid.
    """

    settings: Settings
    target: Target
    analysis: Analysis | None
    observed: dict[int, Float[np.ndarray, "y x"]]


def prepare(
    path: str | os.PathLike[str],
    *,
    bands: Sequence[int] | None = None,
    options: Mapping[str, int | str | None] | None = None,
    ignore_weather: bool = False,
    weather_mask: bool = False,
) -> Run:
    """Read and check everything that a run of a scene folder needs.

    **Arguments:**

    - `bands`: by default those of `scene.toml`, else those that suit the hour.
    - `options`: of the fit, by the names of `FitSettings`; None leaves one as it is.
    - `ignore_weather`: do not look at the folder's weather files.
    - `weather_mask`: take where clouds are from the weather, by the paper's Table 1,
      and not from the imagery.

    **Raises:** `DataError` for anything that stands in the way of the run.
    """
    folder = open_folder(path)
    settings = with_options(folder_settings(folder), options or {})
    chosen = tuple(bands or settings.bands or default_bands(folder))
    scene = folder.read(chosen).on_common_grid()
    analysis = None if ignore_weather else read_analysis(folder, scene)
    target = observe(scene, chosen, cloud_rule(settings, chosen))
    if weather_mask:
        if analysis is None:
            raise DataError(
                f"{folder.path} holds no weather file to take a mask from: add the GFS "
                "analysis of that hour, or do without --weather-mask."
            )
        target = analysis.masked(target)
    # For its errors: better now than after the textures.
    scene_of(settings, target, analysis)
    observed = {number: band.radiance for number, band in scene.bands.items()}
    return Run(settings, target, analysis, observed)


def folder_settings(folder: SceneFolder) -> Settings:
    """The settings in a folder's `scene.toml`."""
    return read_settings(folder.settings, str(folder.path / "scene.toml"))


def default_bands(folder: SceneFolder) -> tuple[int, ...]:
    """The bands to use when nobody says which, as far as the folder has them."""
    if not folder.bands:
        return DAY_BANDS
    number, file = list(folder.bands.items())[-1]
    day = is_day(sun_heights_deg(read_band(file, band=number)))
    usual = DAY_BANDS if day else NIGHT_BANDS
    telling = (*BRIGHT, *COLD_K) if day else tuple(COLD_K)
    for choice in (usual, telling, folder.bands):
        held = tuple(sorted(set(choice) & set(folder.bands)))
        if held:
            return held
    return usual


def read_analysis(folder: SceneFolder, scene: AbiScene) -> Analysis | None:
    """The folder's weather analysis nearest to the scan, None without any.

    **Raises:** `DataError` if one is unreadable or hours away from the imagery.
    """
    cubes = [read_weather(file) for file in folder.weather]
    for cube in cubes:
        check_time(scene.time, cube)
    if not cubes:
        return None
    return Analysis(min(cubes, key=lambda cube: abs(cube.valid_time - scene.time)))
