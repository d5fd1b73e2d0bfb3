"""What lies below an overcast: no pixel shows it, a table and the weather tell it."""

from collections.abc import Mapping
from datetime import datetime

import numpy as np
from jaxtyping import Float

from cloudjax import Band, LatLonGrid
from cloudjax.geometry.geodesy import up
from cloudjax.light import planck
from cloudjax_data import DataError, sun_direction

from .background import Background
from .imagery_scene import path_reflectance
from .lights import PAPER
from .surface import Surface


# The ground is seen in these; in the others the air hides it, and what is seen is the
# air's own, which no table of the ground tells.
TELLING = (1, 2, 3, 5, 6, 7, 11, 13, 14, 15)


def assumed_background(
    bands: Mapping[int, Band],
    surface: Surface,
    earth_sun_distance_au: float,
    time: datetime,
    latitude_deg: Float[np.ndarray, " lat"],
    longitude_deg: Float[np.ndarray, " lon"],
) -> Background:
    """Return radiances by band of the ground of a table, under the air that scatters.

    What the air absorbs and emits is left out, some kelvins in a window.

    **Raises:** `DataError` for a band in which the air hides the ground.
    """
    hidden = [n for n in bands if n not in TELLING]
    if hidden:
        listed = ", ".join(map(str, hidden))
        raise DataError(
            "The scene has no clear pixel, and nothing tells what is below its clouds "
            f"in band {listed}, where the air hides the ground: use bands of "
            f"{', '.join(map(str, TELLING))}, or another rule for cloud."
        )
    φ, λ = (
        axis.reshape(-1)
        for axis in np.meshgrid(latitude_deg, longitude_deg, indexing="ij")
    )
    height = np.maximum(up(φ, λ) @ sun_direction(time), 0.0)
    cover = surface.cover(φ, λ)
    found = {}
    for number, band in bands.items():
        radiance = np.zeros(φ.shape)
        given = band.coefficients(earth_sun_distance_au)
        if band.sunlit:
            (albedo,) = cover.reflectance([number])
            path = path_reflectance(band, PAPER) * (height > 0) if number < 7 else 0.0
            radiance += (albedo * height + path) / given["kappa0"]
        if band.planck is not None:
            (emissivity,) = cover.emissivity([number])
            radiance += emissivity * planck.radiance(*band.planck, cover.temperature_k)
        found[number] = radiance.reshape(len(latitude_deg), len(longitude_deg))
    return Background(LatLonGrid.from_axes(latitude_deg, longitude_deg), found)
