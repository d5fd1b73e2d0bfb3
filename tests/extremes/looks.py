"""A simple scene, what is seen of it, and what must hold of whatever is seen."""

from collections.abc import Callable, Mapping

import jax.numpy as jnp
import numpy as np

from cloudjax import EmissiveBands, Rays, bands_named
from cloudjax.geometry.geodesy import ecef
from tests.extreme_scenes import Kind, Seen, seen_from
from tests.extreme_views import view_of
from tests.helpers import GEOSTATIONARY_M, rays_to, sun


SIMPLE = Kind()
COUNT = 64
# A band in sunlight and one in emission: W m-2 sr-1 um-1 and mW m-2 sr-1 (cm-1)-1.
SUNLIT, THERMAL = 0, 1
CLOUDY, CLEAR = 1e4, -1e4
# A thick, low deck with an even top.
DECK = {
    "base_m": 800.0,
    "top_m": 2500.0,
    "barrier_scale_m": 200.0,
    "extinction_per_m": 0.02,
    "extinction_growth": 0.0,
    "infrared_ratio": 0.5,
    "radius_um": 10.0,
    "absorption": 1.0,
    "offset_k": 0.0,
    "ground_k": 290.0,
    "emissivity": 0.98,
    "albedo": 0.1,
}


def near(latitude=20.0, longitude=10.0, pixel_rad=5.6e-5, spread=1.0) -> Rays:
    """From geostationary orbit above the longitude, around a place."""
    turn = np.radians(longitude)
    origin = np.linalg.norm(GEOSTATIONARY_M) * np.array([np.cos(turn), np.sin(turn), 0])
    offsets = np.random.default_rng(0).uniform(-spread, spread, (2, COUNT))
    φ = np.clip(latitude + offsets[0], -90, 90)
    return rays_to(origin, ecef(φ, longitude + offsets[1], np.zeros(COUNT)), pixel_rad)


def seen_by(
    rays: Rays | None = None,
    zenith: float | np.ndarray = 40.0,
    mask: float | Callable = 0.0,
    kind: Kind = SIMPLE,
    displacements=None,
    at: Mapping[str, float] | None = None,
    **values: float,
) -> Seen:
    """Look, and require that all is finite, derivatives of both modes too.

    **Arguments:** `zenith`: of the sun, or where it is; `mask`: everywhere, or by
    latitude and longitude; `at`, `values`: of parameters.
    """
    direction = zenith if isinstance(zenith, np.ndarray) else sun(zenith)
    rays = near() if rays is None else rays

    def by_place(φ, λ):
        return mask(φ, λ) if callable(mask) else 0 * φ + mask

    view = view_of(kind, rays, direction, by_place, displacements=displacements)
    vector = kind.vector(**(DECK | dict(at or {}) | values))
    found = seen_from(kind, np.tile(vector, (len(rays), 1)), view)
    for name, part in zip(found._fields, found, strict=True):
        assert np.isfinite(part).all(), name
    assert found.radiance.min() > -1e-3
    assert found.through.min() >= 0
    assert found.through.max() <= 1 + 1e-6
    return found


def mean(seen: Seen, band: int) -> float:
    return float(seen.radiance[:, band].mean())


def black(kelvin: float) -> float:
    bands = EmissiveBands.of(bands_named(13))
    assert bands is not None
    return float(bands.planck(jnp.asarray([kelvin]))[0, 0])


def kelvin_of(seen: Seen) -> float:
    bands = EmissiveBands.of(bands_named(13))
    assert bands is not None
    radiance = jnp.asarray(seen.radiance[:, THERMAL].mean(), float)
    return float(bands.brightness_temperature_k(radiance[None, None])[0, 0])


def require_close(found: float, expected: float, part: float) -> None:
    assert abs(found - expected) <= part * abs(expected), (found, expected)
