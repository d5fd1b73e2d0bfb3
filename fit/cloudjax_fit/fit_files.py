"""The files of a fit: numbers, parameters, image and report, all or none of them."""

import dataclasses
import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from cloudjax import Layer, ParticleOptics
from cloudjax.clouds.visibility import VISIBLE_DEPTH
from cloudjax_data.whole_files import staged
from cloudjax_scenes.band_image import BandImage
from cloudjax_scenes.image_file import image_dataset
from cloudjax_scenes.netcdf import write_netcdf
from cloudjax_scenes.quality import Quality

from .cautions import missing_share
from .fit_result import FitResult
from .fitted_cloud import OBSERVED_WATER, FittedCloud
from .parameter_file import parameters_text
from .parameters import Parameter
from .plain_data import plain
from .report import (
    BandReport,
    FitReport,
    ParameterRow,
    WeightedPixels,
    format_number,
    write_fit_report,
)
from .result_numbers import distance_numbers, estimate_numbers
from .texture import FEWEST_ROWS, TexturePair, texture
from .uncertainty import Estimate
from .versions import versions


Images = Mapping[int, Float[np.ndarray, "y x"]]

# Written last: where it is, the others are whole.
NUMBERS = "fit.json"
PARAMETERS = "parameters.toml"
IMAGE = "simulated.nc"
REPORT = "report.html"
FILES = NUMBERS, PARAMETERS, IMAGE, REPORT


def write_fit(
    result: FitResult,
    folder: str | os.PathLike[str],
    observed_images: Images | None = None,
    *,
    asked: str = "",
) -> dict[str, Any]:
    """Write `fit.json`, `parameters.toml`, `simulated.nc` and `report.html`.

    **Arguments:**

    - `observed_images`: radiances by band on the target's grid, to show beside the
        simulated ones; scenes that were reduced to a target have none.
    - `asked`: a digest of what the fit was asked to do (`asked_of`).

    **Returns:** the content of `fit.json`.

    **Raises:** `DataError` if the disk does not take the files.
    """
    imagery, found = result.target.imagery, _values(result)
    values = {parameter.name: value for parameter, value in found.items()}
    title = f"Parameters of {imagery.name}, {imagery.platform}, {_time(result)}"
    if result.interrupted:
        title += f": {result.status}"
    image = image_dataset(
        result.image,
        imagery,
        values,
        result.settings.seed,
        light=result.made_of.light,
        quality=Quality(steps=result.settings.steps),
    )
    textures = _textures(result, observed_images or {})
    numbers = fit_numbers(result, textures) | {"asked": asked}
    with staged(folder, last=NUMBERS) as aside:
        made_of = result.made_of
        text = parameters_text(made_of.classes, found, made_of.light, title)
        (aside / PARAMETERS).write_text(text, encoding="utf-8")
        write_netcdf(aside / IMAGE, image)
        page = fit_report(result, observed_images, textures)
        write_fit_report(aside / REPORT, page)
        text = json.dumps(numbers, indent=2, allow_nan=False)
        (aside / NUMBERS).write_text(text + "\n", encoding="utf-8")
    return numbers


def _values(result: FitResult) -> dict[Parameter, float]:
    """All parameters of the fitted scene: those found and those held."""
    found = {e.parameter: e.value for e in result.estimates}
    return found | {p: p.default for p in result.held}


def _textures(result: FitResult, observed: Images) -> dict[int, TexturePair]:
    """The textures of the images by band, of cloud where increments are counted."""
    good, imagery = result.target.good, result.target.imagery
    if not observed or min(good.shape) < FEWEST_ROWS:
        return {}
    scene = imagery.empty_scene
    seen = np.stack([np.where(good, observed[n], 0.0).ravel() for n in scene.bands])
    weights = imagery.rule.weights(jnp.asarray(seen, float), scene)
    clouds = np.asarray(weights).reshape(good.shape) > 0.5, result.image.cloud > 0.5
    return {
        n: TexturePair(
            *(
                texture(image, good, cloud)
                for image, cloud in zip(
                    (observed[n], result.image.band(n)), clouds, strict=True
                )
            )
        )
        for n in result.target.quantiles
    }


def fit_numbers(
    result: FitResult, textures: Mapping[int, TexturePair] | None = None
) -> dict[str, Any]:
    """Return the content of `fit.json`; None stands for what is not finite."""
    textures = textures or {}
    return plain(
        {
            "scene": _scene(result),
            "status": result.state,
            "message": result.status,
            "warnings": list(result.warnings),
            "seconds": result.seconds,
            "settings": asdict(result.settings),
            "seeds": {"seed": result.settings.seed},
            "cloud_fraction": cloud_fractions(result),
            "cloud_optical_depth": optical_depths(result),
            "clouds": {n: _cloud_numbers(c) for n, c in fitted_clouds(result).items()},
            "bands": {
                str(n): _band_numbers(result, n, textures.get(n))
                for n in result.target.quantiles
            },
            "parameters": {
                e.parameter.name: estimate_numbers(e) for e in result.estimates
            },
            "held": {p.name: p.default for p in result.held},
            "undetermined": result.undetermined,
            "history": list(result.history),
            "versions": versions(),
        }
    )


def cloud_fractions(result: FitResult) -> dict[str, float]:
    """Return the share of the pixels with data that counts as cloud, observed and
    simulated.
    """
    seen = np.isfinite(result.image.radiance).all(axis=0) & result.target.good
    return {
        "observed": result.target.cloud_fraction,
        "start": float(result.start.cloud[seen].mean()),
        "simulated": float(result.image.cloud[seen].mean()),
    }


def optical_depths(result: FitResult) -> dict[str, float]:
    """Return quartiles of the vertical optical depth at 0.64 µm of cloudy pixels."""
    image, counted = result.image, result.target.good
    return _named(_quartiles(image.optical_depth[(image.cloud > 0.5) & counted]))


def fitted_clouds(result: FitResult) -> dict[str, FittedCloud]:
    """Find what each class of the fitted clouds is made of."""
    share, counted = result.made_of.light.share, result.target.good
    return {
        layer.name: _fitted_cloud(layer, share, depth[counted])
        for layer, depth in zip(result.scene.layers, result.image.depths, strict=True)
    }


def _fitted_cloud(layer: Layer, share: float, depth) -> FittedCloud:
    if not isinstance(layer.optics, ParticleOptics):
        raise TypeError(f"The layer {layer.name} has no particles to weigh.")
    particles, extinction_per_m = layer.optics.particles, layer.extinction_per_m / share
    return FittedCloud(
        effective_radius_um=float(particles.effective_radius_um),
        physical_extinction_per_m=float(extinction_per_m),
        water_content_g_m3=float(particles.water_content_g_m3(extinction_per_m)),
        optical_depth=_quartiles(depth[depth > VISIBLE_DEPTH]),
        observed_water_g_m3=OBSERVED_WATER.get(layer.name),
    )


def _quartiles(depth: Float[np.ndarray, " pixels"]) -> tuple[float, float, float]:
    if not depth.size:
        return math.nan, math.nan, math.nan
    lower, median, upper = np.quantile(depth, (0.25, 0.5, 0.75))
    return float(lower), float(median), float(upper)


def _named(quartiles: tuple[float, float, float]) -> dict[str, float]:
    return dict(zip(("lower", "median", "upper"), quartiles, strict=True))


def _cloud_numbers(cloud: FittedCloud) -> dict[str, Any]:
    return asdict(cloud) | {
        "optical_depth": _named(cloud.optical_depth),
        "thickness_m": cloud.thickness_m,
        "water_path_g_m2": cloud.water_path_g_m2,
        "believable": cloud.believable,
    }


def fit_report(
    result: FitResult,
    observed_images: Images | None = None,
    textures: Mapping[int, TexturePair] | None = None,
) -> FitReport:
    """Gather what the page of a fit shows."""
    images, textures = observed_images or {}, textures or {}
    return FitReport(
        title=f"Fit of {result.target.imagery.name}",
        scene=_facts(result),
        status=_status_sentence(result),
        converged=result.converged,
        interrupted=result.interrupted,
        bands=[
            _band_report(result, n, images, textures.get(n))
            for n in result.target.quantiles
        ],
        clouds=fitted_clouds(result),
        parameters=[parameter_row(estimate) for estimate in result.estimates],
        undetermined=result.undetermined,
        warnings=result.warnings,
        history=result.history,
        seconds=result.seconds,
        seeds={"seed": result.settings.seed},
        versions=versions(),
    )


def _scene(result: FitResult) -> dict[str, Any]:
    imagery = result.target.imagery
    return {
        "name": imagery.name,
        "platform": imagery.platform,
        "time": imagery.time.astimezone(UTC).isoformat(),
        "shape": list(imagery.grid.shape),
        "bands": list(imagery.bands),
        "cloud_rule": str(imagery.rule),
        "layers": list(imagery.fractions),
        "missing_share": _missing(result),
    }


def _missing(result: FitResult) -> float:
    return missing_share(result.target, result.image.on_earth)


def _band_numbers(
    result: FitResult, number: int, textures: TexturePair | None
) -> dict[str, Any]:
    band = result.target.imagery.bands[number]
    start, fitted = result.distances_start[number], result.distances_fit[number]
    return {
        "units": band.units,
        "wavelength_um": band.wavelength_um,
        "n_pixels": fitted.n_observed,
        "std_observed": fitted.std_observed,
        **distance_numbers(start, "start"),
        **distance_numbers(fitted, "fit"),
    } | ({"texture": textures.numbers()} if textures else {})


def _facts(result: FitResult) -> dict[str, str]:
    imagery, clouds = result.target.imagery, cloud_fractions(result)
    rows, columns = imagery.grid.shape
    held = ", ".join(f"{p.name} = {format_number(p.default)}" for p in result.held)
    return {
        "scene": imagery.name,
        "satellite": imagery.platform,
        "time": _time(result),
        "pixels": f"{rows} × {columns}, {_missing(result):.1%} without data",
        "cloud pixels": f"{imagery.rule}",
        "cloud fraction": f"{clouds['observed']:.1%} observed, "
        f"{clouds['simulated']:.1%} simulated ({clouds['start']:.1%} at the start)",
        "layers": ", ".join(imagery.fractions),
        "light": result.settings.light,
        "optical depth": "{median:.3g} ({lower:.3g} to {upper:.3g}), vertical, of "
        "cloud pixels at 0.64 µm".format(**optical_depths(result)),
        "fitted with": f"{result.settings.rays} rays of {result.settings.steps} steps",
    } | ({"held": held} if held else {})


def _status_sentence(result: FitResult) -> str:
    first, last = (format_number(result.history[i]) for i in (0, -1))
    steps = f"The loss fell from {first} to {last} in {len(result.history) - 1} steps."
    return steps if result.converged else f"{result.status.rstrip('. ')}. {steps}"


def _band_report(
    result: FitResult, number: int, observed: Images, textures: TexturePair | None
) -> BandReport:
    imagery = result.target.imagery
    band, coefficients = imagery.bands[number], imagery.coefficients(number)
    simulated = BandImage(band, coefficients, result.image.band(number))
    seen = None
    if number in observed:
        seen = dataclasses.replace(simulated, radiance=observed[number]).shown
    return BandReport(
        number=number,
        name=simulated.title,
        units=band.units,
        observed=result.target.quantiles[number],
        simulated_start=_pixels(result, result.start, number),
        simulated_fit=_pixels(result, result.image, number),
        distances_start=result.distances_start[number],
        distances_fit=result.distances_fit[number],
        display=simulated.display,
        observed_image=seen,
        simulated_image=simulated.shown,
        textures=textures,
    )


def _pixels(result: FitResult, image, number: int) -> WeightedPixels:
    counted = result.target.good
    return WeightedPixels(image.band(number)[counted], image.cloud[counted])


def parameter_row(estimate: Estimate) -> ParameterRow:
    """Return a fitted parameter as reports show it."""
    parameter = estimate.parameter
    return ParameterRow(
        name=parameter.name,
        value=estimate.value,
        std=estimate.std,
        start=estimate.start,
        unit=parameter.unit,
        prior=_prior(parameter),
        lower=parameter.lower,
        upper=parameter.upper,
        determined=estimate.determined,
        at_bound=estimate.at_bound,
    )


def _prior(parameter: Parameter) -> str:
    middle = format_number(parameter.default)
    if parameter.log:
        return f"{middle} ×/÷ {format_number(math.exp(parameter.spread))}"
    return f"{middle} ± {format_number(parameter.spread)}"


def _time(result: FitResult) -> str:
    return f"{result.target.imagery.time.astimezone(UTC):%Y-%m-%d %H:%M:%S} UTC"
