"""What is rendered, fitted and compared: the only part that knows how."""

import json
from dataclasses import replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import xarray as xr

from cloudjax import ClearSky, LatLonGrid, render
from tests.commands import run
from tests.helpers import (
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    layer,
    make_scene,
    reflective_bands,
    sun,
)
from tests.scenes import write_scene

from .stored import share


# Every one of so many pixels of an image is stored.
APART = 8
RENDERED = (
    "radiance_C02",
    "radiance_C13",
    "cloud_fraction",
    "cloud_optical_depth",
    "cloud_top_height",
)


def fractal_image() -> dict[str, np.ndarray]:
    """600 pixels of 2 km of one fractal cloud, by band, without a file."""
    cloud = layer(fractal_cloud(nodes=3))
    scene = make_scene([cloud], reflective_bands(1), emissive_bands(13))

    grid = LatLonGrid.from_axes(np.array([-90.0, 90.0]), np.arange(0.0, 360.0, 120.0))
    even = jnp.ones((*grid.shape, 1))
    scene = replace(scene, ground=ClearSky(20 * even, 100 * even, grid))
    rays = geostationary_rays(600, 8.0)
    seen = render(scene, rays, sun(40.0)).radiances
    assert seen.reflective is not None
    assert seen.emissive is not None
    return {
        "radiance_C01": np.asarray(seen.reflective[0]),
        "radiance_C13": np.asarray(seen.emissive[0]),
    }


def image_of(file: Path) -> dict[str, np.ndarray]:
    """Some pixels of a file of `cloudjax render`."""
    with xr.open_dataset(file) as data:
        return {
            name: data[name].to_numpy()[APART // 2 :: APART, APART // 2 :: APART]
            for name in RENDERED
        }


def comparison(folder: Path) -> tuple[dict, dict]:
    """Distances and textures of two generated scenes, from report.json, and what
    rounding may change of them.

    Distances are sums in float64 of what files hold in integers; textures are found in
    float32.
    """
    a = write_scene(folder / "a")
    b = write_scene(folder / "b", seed=10)
    result = run("report", a, b, "-o", folder / "out")
    assert result.exit_code == 0, result.output
    bands = json.loads((folder / "out" / "report.json").read_text())["bands"]
    distances = {
        f"C{int(band):02d} {name}": value
        for band, numbers in bands.items()
        for name, value in numbers.items()
        if name not in ("units", "texture")
    }
    textures = {
        f"C{int(band):02d} {name}": np.array(numbers["texture"][name], float)
        for band, numbers in bands.items()
        for name in ("power_ratio_db", "increment_ratio")
    }
    allowed = share(distances, 1e-6) | share(textures, 1e-4)
    return distances | textures, allowed


def numbers_of(fit_json: Path) -> tuple[dict, dict]:
    """What a fit found, and what rounding may change of it.

    The start and the first two steps are exact to rounding. Ten steps make it grow:
    another order of summation moved values by a third of their standard deviations,
    deviations by 10 % and distances by 3 %.
    """
    fit = json.loads(fit_json.read_text())
    exact = {
        f"C{int(band):02d} w1_start_over_std": numbers["w1_start_over_std"]
        for band, numbers in fit["bands"].items()
    } | {"first losses": np.array(fit["history"][:3])}
    grown = {
        f"C{int(band):02d} w1_fit_over_std": numbers["w1_fit_over_std"]
        for band, numbers in fit["bands"].items()
    } | {
        f"cloud fraction {when}": fraction
        for when, fraction in fit["cloud_fraction"].items()
    }
    found = {name: of["value"] for name, of in fit["parameters"].items()}
    std = {f"{name}, std": of["std"] for name, of in fit["parameters"].items()}
    allowed = share(exact, 1e-4) | share(grown, 0.06) | share(std, 0.25)
    return exact | grown | found | std, allowed | {
        name: 0.9 * of["std"] for name, of in fit["parameters"].items()
    }
