"""All that a fit or an image of a scene folder needs, read and checked."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from cloudjax import CloudClass, load_classes
from cloudjax_data import (
    AbiBand,
    AbiScene,
    DataError,
    SceneFolder,
    check_time,
    open_folder,
    read_band,
    read_weather,
)
from cloudjax_scenes.cloud_rule import BRIGHT, COLD_K
from cloudjax_scenes.data_errors import data_errors
from cloudjax_scenes.daylight import shows_sunlit_clouds, sun_heights_deg
from cloudjax_scenes.imagery_scene import SceneFromImagery
from cloudjax_scenes.lights import light_named
from cloudjax_scenes.weather_analysis import Analysis
from cloudjax_scenes.weather_cover import held_share

from .observation import observe
from .parameter_file import FittedParameters
from .parameters import Parameter
from .settings import (
    Settings,
    changed_parameters,
    cloud_rule,
    overrides_for,
    read_settings,
    with_options,
)
from .targets import Target


# Blue and near infrared tell cloud from land and sea, the window how high it is.
DAY_BANDS = (1, 3, 13)
# What two windows differ by tells thin from broken cloud.
NIGHT_BANDS = (13, 15)


@dataclass(frozen=True, eq=False)
class FitInputs:
    """A scene folder, read and checked, ready to be fitted or rendered.

    **Fields:**

    - `settings`: of the scene's `scene.toml` and of the options, checked.
    - `target`: the scene, reduced.
    - `made_of`: what its scene is built of: imagery, weather, classes, light.
    - `parameters`: of that scene, with the changes of the settings.
    - `observed`: radiances by band on the target's grid.
    - `fitted`: values to render the scene with; None for those of the settings.
    """

    settings: Settings
    target: Target
    made_of: SceneFromImagery
    parameters: list[Parameter]
    observed: dict[int, Float[np.ndarray, "y x"]]
    fitted: FittedParameters | None = None

    @property
    def analysis(self) -> Analysis | None:
        """Give the weather of the hour, where the folder has it."""
        return self.made_of.analysis

    @property
    def overrides(self) -> dict[str, Mapping[str, Any]]:
        """Give those changes of parameters that concern the scene."""
        return overrides_for(self.settings, self.made_of)


def read_inputs(
    path: str | os.PathLike[str],
    *,
    bands: Sequence[int] | None = None,
    options: Mapping[str, int | str | None] | None = None,
    classes: str | os.PathLike[str] | None = None,
    fitted: FittedParameters | None = None,
    ignore_weather: bool = False,
    weather_mask: bool = False,
) -> FitInputs:
    """Read and check everything that a fit or an image of a scene folder needs.

    **Arguments:**

    - `bands`: by default those of `scene.toml`, else those that suit the hour.
    - `options`: of the fit, by the names of `FitSettings`; None leaves one as it is.
    - `classes`: a file of classes of cloud; by default that of `scene.toml`, else those
      that the light has for imagery.
    - `fitted`: what a fit has found, to render the scene with: its classes and its
      light go before all others.
    - `ignore_weather`: do not look at the folder's weather files.
    - `weather_mask`: take where clouds are from the weather, by the conditions of the
      classes, and not from the imagery.

    **Raises:** `DataError` for anything that stands in the way of the run.
    """
    folder = open_folder(path)
    settings = with_options(folder_settings(folder), options or {})
    if fitted is not None:
        settings = with_options(settings, {"light": fitted.light})
    chosen = tuple(bands or settings.bands or default_bands(folder))
    known = fitted.classes if fitted else None
    known = known or _classes(classes, settings, folder)
    told = known or light_named(settings.fit.light).imagery_classes()
    scene = folder.read(chosen).on_common_grid()
    analysis = None if ignore_weather else read_analysis(folder, scene)
    weather = None if analysis is None else analysis.cube
    target = observe(scene, chosen, cloud_rule(settings, chosen), told, weather)
    if weather_mask:
        if analysis is None:
            raise DataError(
                f"{folder.path} holds no weather file to take a mask from: add the GFS "
                "analysis of that hour, or do without --weather-mask."
            )
        target = replace(target, imagery=analysis.masked(target.imagery, told))
    placed = fitted is None or fitted.classes is None
    made_of = settings.fit.scene_from(target.imagery, analysis, known, placed=placed)
    observed = {number: band.radiance for number, band in scene.bands.items()}
    parameters = changed_parameters(settings, made_of, to_fit=fitted is None)
    return FitInputs(settings, target, made_of, parameters, observed, fitted)


def _classes(
    given: str | os.PathLike[str] | None, settings: Settings, folder: SceneFolder
) -> dict[str, CloudClass] | None:
    """The classes of a file that is asked for, None for those of the light."""
    if given is None and settings.classes is not None:
        given = folder.path / settings.classes
    if given is None:
        return None
    with data_errors():
        return load_classes(given)


def folder_settings(folder: SceneFolder) -> Settings:
    """Read the settings in a folder's `scene.toml`."""
    return read_settings(folder.settings, str(folder.path / "scene.toml"))


def default_bands(folder: SceneFolder) -> tuple[int, ...]:
    """Return the bands to use when nobody says which, as far as the folder has them."""
    if not folder.bands:
        return DAY_BANDS
    some = _some_band(folder)
    day = shows_sunlit_clouds(sun_heights_deg(some.grid, some.time))
    usual = DAY_BANDS if day else NIGHT_BANDS
    telling = (*BRIGHT, *COLD_K) if day else tuple(COLD_K)
    for choice in (usual, telling, folder.bands):
        held = tuple(sorted(set(choice) & set(folder.bands)))
        if held:
            return held
    return usual


def _some_band(folder: SceneFolder) -> AbiBand:
    """The last band that can be read: the others may be of a finer, slower grid."""
    failed = None
    for number, file in reversed(folder.bands.items()):
        try:
            return read_band(file, band=number)
        except DataError as error:
            failed = failed or error
    assert failed is not None
    raise failed


def read_analysis(folder: SceneFolder, scene: AbiScene) -> Analysis | None:
    """Read the folder's weather analysis that holds most of the scene, and of several
    the nearest in time; None without any.

    **Raises:** `DataError` if none serves: unreadable, hours away or of another place.
    """
    found, errors = [], []
    for file in folder.weather:
        try:
            cube = read_weather(file)
            check_time(scene.time, cube)
            share = held_share(cube, scene.grid)
        except DataError as error:
            errors.append(error)
            continue
        apart = abs((cube.valid_time - scene.time).total_seconds())
        found.append((round(share, 3), -apart, cube))
    if errors and not found:
        raise errors[0]
    if not found:
        return None
    *_, best = max(found, key=lambda one: one[:2])
    return Analysis(best, tuple(map(str, errors)))
