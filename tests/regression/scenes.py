"""What is rendered, fitted and compared: the only part that knows how."""

import json
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import xarray as xr

from cloudjax import BandRadiances, render
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

    def behind(index) -> BandRadiances:
        one = jnp.ones((1, len(index)))
        return BandRadiances(20 * one, 100 * one)

    rays = geostationary_rays(600, 8.0)
    seen = render(scene, rays, sun(40.0), behind, resolution=16).radiances
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


def comparison(folder: Path) -> dict[str, float]:
    """Distances of two generated scenes, from report.json."""
    a = write_scene(folder / "a")
    b = write_scene(folder / "b", seed=10)
    result = run("report", a, b, "-o", folder / "out")
    assert result.exit_code == 0, result.output
    bands = json.loads((folder / "out" / "report.json").read_text())["bands"]
    return {
        f"C{int(band):02d} {name}": value
        for band, numbers in bands.items()
        for name, value in numbers.items()
        if name != "units"
    }


def numbers_of(fit_json: Path) -> dict[str, np.ndarray | float]:
    """What a fit found: parameters as value and std, distances, shares, losses."""
    fit = json.loads(fit_json.read_text())
    parameters = {
        name: np.array([found["value"], found["std"]], float)
        for name, found in fit["parameters"].items()
    }
    distances = {
        f"C{int(band):02d} {name}": numbers[name]
        for band, numbers in fit["bands"].items()
        for name in ("w1_start_over_std", "w1_fit_over_std", "ks_fit")
    }
    shares = {f"cloud fraction {k}": v for k, v in fit["cloud_fraction"].items()}
    water = {
        f"{name} water_content_g_m3": cloud["water_content_g_m3"]
        for name, cloud in fit["clouds"].items()
    }
    return parameters | distances | shares | water | {"loss": fit["history"]}
