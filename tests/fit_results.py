"""A fit's result without a fit: what is written of it does not ask where it is from."""

import dataclasses

import numpy as np

from cloudjax_fit.fit_inputs import FitInputs
from cloudjax_fit.fit_result import FitResult
from cloudjax_fit.fit_settings import FitSettings
from cloudjax_fit.histogram import distances
from cloudjax_fit.uncertainty import Estimate
from cloudjax_scenes.simulated_image import SimulatedImage


def made_up_result(inputs: FitInputs, *, converged: bool = True) -> FitResult:
    """The observed image, made brighter before and hardly changed after the fit."""
    made_of, parameters = inputs.made_of, inputs.parameters
    image, start = _image(inputs, 1.01), _image(inputs, 1.3)
    free = [p for p in parameters if p.free]
    return FitResult(
        target=inputs.target,
        made_of=made_of,
        settings=FitSettings(seed=7),
        converged=converged,
        status="converged in 2 steps" if converged else "The solver gave up.",
        scene=made_of.build(),
        estimates=[
            Estimate(p, p.default * 1.1, p.default, np.nan, True, False) for p in free
        ],
        held=[dataclasses.replace(p, free=False) for p in parameters if not p.free],
        undetermined=["+0.9 a -0.4 b is known to 0.9 of its prior alone"],
        start=start,
        image=image,
        distances_start=_distances(inputs, start),
        distances_fit=_distances(inputs, image),
        history=(9.0, 4.0, 1.0),
        seconds={"compile": 1.0, "solve": 2.0, "total": 3.5},
        warnings=["Mind the step."],
    )


def _image(inputs: FitInputs, factor: float) -> SimulatedImage:
    numbers = tuple(inputs.target.quantiles)
    radiance = np.stack([inputs.observed[n] * np.float32(factor) for n in numbers])
    radiance[:, 0, :] = np.nan
    cloud = np.isfinite(radiance[0]).astype(float)
    depths = np.stack([5.0 * cloud for _ in inputs.made_of.classes])
    return SimulatedImage(numbers, radiance, cloud, depths)


def _distances(inputs: FitInputs, image: SimulatedImage):
    weights = image.cloud.reshape(-1)
    return {
        number: distances(table, image.band(number).reshape(-1), weights)
        for number, table in inputs.target.quantiles.items()
    }
