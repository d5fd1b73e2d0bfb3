"""What imagery tells of a class of cloud from place to place: depth, top, roughness.

Each field is relative to what the class is like elsewhere, and to what a mask brings
about by itself: cloud is thicker where there is more of it, in any fractal.
"""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from scipy.special import logit, ndtri

from cloudjax import CoarseFields, LatLonGrid
from cloudjax.air.atmosphere import SEA_LEVEL_TEMPERATURE_K

from .cells import Cells


# Cells of the fields are this many pixels wide: finer structure is the textures'.
CELL_PIXELS = 8
# Albedos of cloud that optical depths are told from.
_ALBEDOS = 0.01, 0.85
# Optical depth of an albedo of one half, 2/(1 - g) for g = 0.85: two streams.
_HALF_DEPTH = 13.3
# Absorption in the window over extinction at 0.64 µm, and the cosine of a usual view.
_ABSORBED, _SLANT = 0.5, 0.75
_LEAST_EMISSIVITY = 0.1
_LAPSE_K_PER_M = 0.0065
# How far fields may go from their mean; tops by a part of the shell.
_MOST_DEPTH, _MOST_ROUGHNESS = 2.5, 1.5
_MOST_OF_SHELL, _MOST_TOP_M = 0.35, 500.0
# Pixels of increments.
_LAGS = 1, 2
# A mask of nothing or of everything says no more than this.
_EDGE = 0.02


@dataclass(frozen=True, eq=False)
class ClassEvidence:
    """What imagery tells of one class of cloud from place to place.

    **Fields:**

    - `latitude_deg`, `longitude_deg`: of the cells.
    - `nodes`: as of `CoarseFields`.
    - `top_m`: mean altitude of the tops.
    """

    latitude_deg: Float[np.ndarray, " lat"]
    longitude_deg: Float[np.ndarray, " lon"]
    nodes: Float[np.ndarray, "lat lon 3"]
    top_m: float

    @property
    def fields(self) -> CoarseFields:
        """Give the fields that the clouds of the class follow."""
        grid = LatLonGrid.from_axes(self.latitude_deg, self.longitude_deg)
        return CoarseFields(jnp.asarray(self.nodes, float), grid)


@dataclass(frozen=True, eq=False)
class Seen:
    """What the evidence is found in, pixel by pixel.

    **Fields:**

    - `albedo`: of the cloud: what is brighter than the ground over what is darker than
      white.
    - `emissivity`: of the cloud in the window.
    - `window`, `clear`: radiance in the window, and without cloud.
    - `detail`: what differs more between neighbours where clouds are rougher.
    """

    albedo: Float[np.ndarray, "y x"]
    emissivity: Float[np.ndarray, "y x"]
    window: Float[np.ndarray, "y x"]
    clear: Float[np.ndarray, "y x"]
    detail: Float[np.ndarray, "y x"]

    @classmethod
    def by_day(cls, albedo: Float[np.ndarray, "y x"], window, clear) -> "Seen":
        """Tell emissivities by albedos (`cloud_albedo`)."""
        depth = _HALF_DEPTH * albedo / (1 - albedo)
        emissivity = 1 - np.exp(-_ABSORBED * depth / _SLANT)
        emissivity = np.clip(emissivity, _LEAST_EMISSIVITY, 1)
        return cls(albedo, emissivity, window, clear, logit(albedo))

    @classmethod
    def by_night(cls, window: Float[np.ndarray, "y x"], clear, kelvin) -> "Seen":
        """Take clouds for opaque and alike: thin high cloud looks as thick lower one.

        **Arguments:** `kelvin`: brightness temperature in the window.
        """
        return cls(
            np.full(window.shape, 0.5), np.ones(window.shape), window, clear, kelvin
        )


def cloud_albedo(reflectance, ground) -> Float[np.ndarray, "*pixels"]:
    """Return the albedo of cloud over ground, of their reflectances over the sun's."""
    return np.clip((reflectance - ground) / (1 - np.minimum(ground, 0.9)), *_ALBEDOS)


def class_evidence(
    cells: Cells,
    places: tuple,
    own: Bool[np.ndarray, "y x"],
    fraction: Float[np.ndarray, "y x"],
    depth_m: float,
    seen: Seen,
    kelvin: Callable[[np.ndarray], np.ndarray],
) -> ClassEvidence:
    """Find what the pixels of a class tell.

    **Arguments:**

    - `places`: latitude and longitude of the pixels at the clouds, and whether they
      meet that altitude (`places_at`).
    - `own`: the pixels of the class.
    - `fraction`: of the sky that the class covers around each pixel, as masks have it.
    - `depth_m`: of its shell.
    - `kelvin`: from a radiance in the window to its brightness temperature.
    """
    pixels = _PixelsInCells(cells, *places)
    mean, count = pixels.mean, pixels.count(own)
    depth = logit(mean(seen.albedo, own))
    emissivity = seen.emissivity
    # The radiance of black bodies as high as the tops.
    black = mean(seen.clear + (seen.window - seen.clear) / emissivity, own, emissivity)
    below = SEA_LEVEL_TEMPERATURE_K - kelvin(np.maximum(black, 1e-3))
    top = below / _LAPSE_K_PER_M
    rough = np.log(np.maximum(_roughness(mean, seen.detail, own), 1e-3))
    mask = mean(ndtri(_EDGE + (1 - 2 * _EDGE) * fraction), own)
    parts = [
        np.clip(_beside_the_mask(field, mask, count), -most, most)
        for field, most in (
            (depth, _MOST_DEPTH),
            (top, max(_MOST_OF_SHELL * depth_m, _MOST_TOP_M)),
            (rough, _MOST_ROUGHNESS),
        )
    ]
    return ClassEvidence(
        cells.latitude_deg,
        cells.longitude_deg,
        np.stack(parts, axis=-1),
        float(np.average(top, weights=count)),
    )


@dataclass(frozen=True, eq=False)
class _PixelsInCells:
    """Pixels of an image, to be averaged over cells where they are asked for.

    **Fields:** `cells`: of the grid. `latitude_deg`, `longitude_deg`, `hit`: as in
    `places` of `class_evidence`.
    """

    cells: Cells
    latitude_deg: Float[np.ndarray, " pixels"]
    longitude_deg: Float[np.ndarray, " pixels"]
    hit: Bool[np.ndarray, " pixels"]

    def mean(
        self,
        values: Float[np.ndarray, "y x"],
        where: Bool[np.ndarray, "y x"],
        weights: Float[np.ndarray, "y x"] | None = None,
    ) -> Float[np.ndarray, "lat lon"]:
        latitude, longitude, use = self._chosen(where)
        chosen = None if weights is None else weights.reshape(-1)[use]
        return self.cells.mean(latitude, longitude, values.reshape(-1)[use], chosen)

    def count(self, where: Bool[np.ndarray, "y x"]) -> Float[np.ndarray, "lat lon"]:
        latitude, longitude, use = self._chosen(where)
        return self.cells.total(latitude, longitude, np.ones(use.sum()))

    def _chosen(self, where: Bool[np.ndarray, "y x"]):
        """Places of the pixels that count, and which of all pixels do."""
        use = self.hit & where.reshape(-1)
        return self.latitude_deg[use], self.longitude_deg[use], use


def _roughness(mean, values, own) -> Float[np.ndarray, "lat lon"]:
    """Mean of |differences| between pixels of the class, some pixels apart."""
    found = []
    for lag in _LAGS:
        for axis in (0, 1):
            both = own & np.roll(own, -lag, axis)
            last = [slice(None)] * 2
            last[axis] = slice(-lag, None)
            both[tuple(last)] = False
            if both.any():
                found.append(mean(np.abs(np.roll(values, -lag, axis) - values), both))
    return np.mean(found, axis=0) if found else np.ones(1)


def _beside_the_mask(field, mask, count) -> Float[np.ndarray, "lat lon"]:
    """The field without what goes with the mask, and without its mean."""
    weights = np.sqrt(count)
    basis = np.stack([np.ones_like(mask), mask, mask**2], axis=-1)
    rows = (basis * weights[..., None]).reshape(-1, 3)
    usual, *_ = np.linalg.lstsq(rows, (field * weights).reshape(-1))
    return field - basis @ usual
