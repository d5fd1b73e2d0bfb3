"""The image of a scene at given parameters."""

import os
from dataclasses import replace

import jax.numpy as jnp

from cloudjax_data import DataError
from cloudjax_scenes.shading import shadows_of

from .fitting import SimulatedImage, simulate_image
from .parameter_file import read_parameters
from .parameters import Parameter, put_all
from .scene_run import Run
from .settings import concerning, scene_of


def render_run(
    run: Run,
    parameter_file: str | os.PathLike[str] | None = None,
    *,
    shadows: int = 0,
) -> tuple[SimulatedImage, dict[str, float]]:
    """Simulate all pixels of a run.

    **Arguments:**

    - `parameter_file`: values to use, and the strategy for light that they are for;
      those that it lacks are the settings' defaults.
    - `shadows`: steps towards the sun, 0 for no shadows.

    **Returns:** the image and all parameters that it was made with.

    **Raises:** `DataError` if the file cannot be read, or names a parameter that no
    scene has, or gives one a value beyond its bounds; for shadows with another light
    than the physical one.
    """
    settings, given = run.settings, {}
    if parameter_file is not None:
        given, light = read_parameters(parameter_file)
        if light is not None:
            settings = replace(settings, fit=replace(settings.fit, light=light))
    scene, parameters = scene_of(settings, run.target, run.analysis)
    values = {p.name: p.default for p in parameters}
    if parameter_file is not None:
        values |= concerning(given, run.target, str(parameter_file), settings.fit.light)
        _require_within_bounds(values, parameters, str(parameter_file))
    scene = put_all(
        scene, parameters, jnp.asarray([values[p.name] for p in parameters])
    )
    scene = replace(scene, shadows=shadows_of(shadows, settings.fit.light))
    image = simulate_image(scene, run.target, run.analysis, settings.fit.resolution)
    return image, values


def _require_within_bounds(
    values: dict[str, float], parameters: list[Parameter], source: str
) -> None:
    for p in parameters:
        # Written so that NaN is out of bounds.
        if not p.lower <= values[p.name] <= p.upper:
            raise DataError(
                f"{source} gives {p.name} = {values[p.name]:g}: keep it between "
                f"{p.lower:g} and {p.upper:g}."
            )
