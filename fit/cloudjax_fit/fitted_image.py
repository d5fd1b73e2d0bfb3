"""The image of a scene folder, at fitted parameters or the defaults."""

from collections.abc import Mapping
from dataclasses import replace

import jax.numpy as jnp

from cloudjax import Scene
from cloudjax_data import DataError
from cloudjax_scenes.quality import Quality
from cloudjax_scenes.simulated_image import SimulatedImage, simulate_image

from .fit_inputs import FitInputs
from .parameters import put_all
from .scene_parameters import scene_parameters
from .settings import concerning


def fitted_image(
    inputs: FitInputs, quality: Quality | None = None
) -> tuple[SimulatedImage, dict[str, float]]:
    """Simulate all pixels of a scene folder.

    **Arguments:** `quality`: of the render; by default as in fits.

    **Returns:** the image and all parameters that it was made with: those of
    `inputs.fitted`, and where it says nothing the settings' defaults.

    **Raises:** `DataError` if the fitted parameters name one that no scene has, or give
    one a value beyond its bounds; for shadows with another light than the physical one.
    """
    values = fitted_values(inputs)
    quality = quality or Quality(steps=inputs.settings.fit.steps)
    scene = fitted_scene(inputs, values, shadows=quality.shadows)
    scene = quality.of_scene(scene)
    return simulate_image(scene, inputs.made_of), values


def fitted_scene(
    inputs: FitInputs, values: Mapping[str, float], *, shadows: int = 0
) -> Scene:
    """Build the scene of a folder with values of its parameters.

    **Arguments:** `values`: by name, of all of them; `shadows`: as of `fitted_image`.

    **Raises:** `DataError` for shadows with another light than the physical one.
    """
    made_of, parameters = inputs.made_of, inputs.parameters
    scene = put_all(
        made_of.build(), parameters, jnp.asarray([values[p.name] for p in parameters])
    )
    return replace(scene, shadows=made_of.light.shadows(shadows))


def fitted_values(inputs: FitInputs) -> dict[str, float]:
    """Return values by name: fitted ones go before those of the settings."""
    values = {p.name: p.default for p in inputs.parameters}
    fitted = inputs.fitted
    if fitted is None:
        return values
    for p in scene_parameters(inputs.made_of):
        if p.name.partition(".")[0] in (fitted.classes or {}):
            values[p.name] = p.default
    values |= concerning(fitted.values, inputs.made_of, fitted.source)
    for p in inputs.parameters:
        if not p.allows(values[p.name]):
            raise DataError(
                f"{fitted.source} gives {p.name} = {values[p.name]:g}: keep it between "
                f"{p.lower:g} and {p.upper:g}."
            )
    return values
