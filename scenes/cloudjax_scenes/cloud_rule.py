"""Which pixels are cloud: bright in a reflective band, or cold in a window band.

The rule stands in where no cloud product is at hand. As it stands it says where the
clouds of imagery are. Statistics of observed and of simulated radiances take it with
soft edges, so that both are of the same kind of pixel and a fit has a derivative.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from cloudjax import Scene


# Reflectance factor from which a pixel counts as cloud, by band, in the order in which
# bands are preferred: blue first, in which land is dark. Bands not listed see the
# surface badly or not at all.
BRIGHT = {1: 0.25, 2: 0.25, 3: 0.35, 5: 0.35, 6: 0.30}
# Brightness temperature below which a pixel counts as cloud. Winter land is colder:
# give such a scene a threshold of its own.
COLD_K = {13: 270.0, 14: 270.0, 15: 270.0, 11: 270.0, 16: 258.0, 12: 255.0, 7: 272.0}
# Widths of the soft edges: about the radiometric noise of broken cloud.
BRIGHT_WIDTH = 0.01
COLD_WIDTH_K = 1.0


@dataclass(frozen=True)
class CloudRule:
    """A pixel is cloud if it is bright or cold.

    **Fields:** `bright_band` and `bright_reflectance`, `cold_band` and
    `cold_temperature_k`; a band of None leaves its half of the rule out.
    """

    bright_band: int | None
    bright_reflectance: float
    cold_band: int | None
    cold_temperature_k: float

    def __str__(self) -> str:
        halves = []
        if self.bright_band is not None:
            halves.append(
                f"reflectance in C{self.bright_band:02d} above "
                f"{self.bright_reflectance:g}"
            )
        if self.cold_band is not None:
            halves.append(
                f"brightness temperature in C{self.cold_band:02d} below "
                f"{self.cold_temperature_k:g} K"
            )
        return " or ".join(halves)

    def select(
        self,
        reflectance: Mapping[int, Float[np.ndarray, "*pixels"]],
        temperature_k: Mapping[int, Float[np.ndarray, "*pixels"]],
    ) -> Bool[np.ndarray, "*pixels"]:
        """Select the cloud pixels of an image; NaN is never cloud."""
        parts = []
        if self.bright_band is not None:
            parts.append(reflectance[self.bright_band] > self.bright_reflectance)
        if self.cold_band is not None:
            parts.append(temperature_k[self.cold_band] < self.cold_temperature_k)
        return np.logical_or.reduce(parts)

    def weights(
        self, radiance: Float[Array, "bands rays"], scene: Scene
    ) -> Float[Array, " rays"]:
        """Return the softly selected share of each pixel.

        **Arguments:** `radiance`: in each of `scene.bands`; of the scene, the bands are
        all that counts.
        """
        clear = jnp.asarray(1.0)
        reflective, emissive = scene.reflective, scene.emissive
        if self.bright_band is not None and reflective is not None:
            i = reflective.numbers.index(self.bright_band)
            seen = radiance[scene.bands.index(self.bright_band)]
            reflectance = seen * reflective.reflectance_per_radiance[i]
            clear = clear * jax.nn.sigmoid(
                (self.bright_reflectance - reflectance) / BRIGHT_WIDTH
            )
        if self.cold_band is not None and emissive is not None:
            i = emissive.numbers.index(self.cold_band)
            seen = radiance[scene.bands.index(self.cold_band)]
            # In radiance, which unlike temperature is smooth down to nothing.
            edge, warmer = (
                emissive.planck(jnp.asarray(self.cold_temperature_k + step))[i]
                for step in (0.0, COLD_WIDTH_K)
            )
            clear = clear * jax.nn.sigmoid((seen - edge) / (warmer - edge))
        return 1 - clear


def default_rule(bands: list[int], *, day: bool) -> CloudRule:
    """Return the rule that a set of bands allows.

    **Raises:** `ValueError` if none of the bands tells cloud from surface.
    """
    bright = next((b for b in BRIGHT if day and b in bands), None)
    # By day the sun warms clouds in band 7.
    telling = [b for b in COLD_K if not (day and b == 7)]
    cold = next((b for b in telling if b in bands), None)
    if bright is None and cold is None:
        usable = sorted([*BRIGHT, *telling] if day else telling)
        raise ValueError(
            f"none of the bands {bands} tells cloud from surface by "
            f"{'day' if day else 'night'}: add one of {usable}"
        )
    return CloudRule(
        bright_band=bright,
        bright_reflectance=np.inf if bright is None else BRIGHT[bright],
        cold_band=cold,
        cold_temperature_k=-np.inf if cold is None else COLD_K[cold],
    )
