"""The paper's algorithm for several classes of cloud and several bands, in numba.

As the paper does: one march for each class, then the layers laid over one another.
Reflective bands by eqs (3) and (4), the infrared at the temperature of the first
surface and with eq. (5).
"""

import numba
import numpy as np

from . import brute_numba
from .work import LAPSE_K_PER_M, SEA_LEVEL_K, TROPOPAUSE_K, Picture


def prepare(picture: Picture):
    layers = [brute_numba.arguments(work) for work in picture.layers]
    indirect = picture.layers[0].indirect
    light = picture.depths_per_m, picture.shares, picture.planck, picture.air

    def run() -> np.ndarray:
        seen = picture.behind.astype(np.float32)
        for i, layer in enumerate(layers):
            _overlay(seen, brute_numba.march(*layer), i, indirect, *light)
        return seen

    return run


@numba.njit(parallel=True, fastmath=True)
def _overlay(seen, found, i, indirect, depths_per_m, shares, planck, air):
    bands = len(seen)
    for ray in numba.prange(seen.shape[1]):
        depth, cosine, altitude, height = found[:, ray]
        for band in range(bands):
            τ = depths_per_m[i, band] * depth
            passed = np.exp(-τ)
            if band < bands - 1:
                own = brute_numba.shade(τ, cosine, height, indirect)
                own = air[band] * (1 - passed) + shares[i, band] * own
            else:
                kelvin = max(SEA_LEVEL_K - LAPSE_K_PER_M * altitude, TROPOPAUSE_K)
                own = planck[0] / np.expm1(planck[1] / (planck[2] + planck[3] * kelvin))
                own *= 1 - passed
            seen[band, ray] = own + passed * seen[band, ray]
