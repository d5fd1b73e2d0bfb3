"""The clear sky of imagery: what its pixels without cloud show."""

from typing import ClassVar

import equinox as eqx
import numpy as np
from jaxtyping import Float

from cloudjax import Band
from cloudjax.geometry.path import device_array
from cloudjax.geometry.rays import GroundPoints
from cloudjax.light.ground import ClearRadiances, ClearSky, GroundSamples

from .imagery import Imagery
from .surface import Surface


# At most so much of a clear radiance at 3.9 µm is the sun's, or nothing would be warm.
MOST_SUN = 0.8


class ImagerySky(ClearSky):
    """Clear radiances of imagery, on the grid that they have.

    Clear pixels show what band 7 reflects and emits as one: by day the sun's part is
    that of the surface's table, and what is left is emission.

    **Fields:**

    - `reflective`, `emissive`: radiances of the bands that see the sun, and of those
      that emit; both parts in both.
    - `grid`: their places.
    - `surface`: the table; None where no band is of both kinds.
    - `kappa0`: of the bands that see the sun.
    - `sunlit`, `thermal`: numbers of the bands.
    """

    surface: Surface | None
    kappa0: tuple[float, ...]
    sunlit: tuple[int, ...] = eqx.field(static=True)
    thermal: tuple[int, ...] = eqx.field(static=True)
    under_air: ClassVar[bool] = False

    @classmethod
    def of(cls, imagery: Imagery) -> "ImagerySky":
        """Make it of the backgrounds of imagery."""
        both = any(not band.reflective for band in imagery.sunlit)
        sunlit = tuple(band.number for band in imagery.sunlit)
        return cls(
            reflective=_nodes(imagery, imagery.sunlit),
            emissive=_nodes(imagery, imagery.emissive),
            grid=imagery.background.grid,
            surface=Surface.of() if both else None,
            kappa0=tuple(imagery.coefficients(n)["kappa0"] for n in sunlit),
            sunlit=sunlit,
            thermal=tuple(band.number for band in imagery.emissive),
        )

    def look(
        self, rays, places, hit, sun_direction, reflective, emissive
    ) -> GroundSamples:
        """Interpolate the radiances to the places, and part those of band 7."""
        samples = super().look(rays, places, hit, sun_direction, reflective, emissive)
        clear: ClearRadiances = samples.properties
        if self.surface is None or clear.reflective is None or clear.emissive is None:
            return samples
        sent = np.array(clear.reflective), np.array(clear.emissive)
        for row, number in enumerate(self.sunlit):
            if number in self.thermal:
                seen = sent[0][:, row]
                height = np.asarray(samples.sun_height, float)
                sun = self._reflected(number, seen, places, height / self.kappa0[row])
                sent[0][:, row] = sun
                sent[1][:, self.thermal.index(number)] -= sun
        parted = ClearRadiances(device_array(sent[0]), device_array(sent[1]))
        return GroundSamples(
            samples.hit, samples.sun_height, samples.altitude_m, parted
        )

    def _reflected(self, number: int, seen, places: GroundPoints, irradiance):
        """The sun's part of a clear radiance, by the table of the surface."""
        assert self.surface is not None
        cover = self.surface.cover(places.latitude_deg, places.longitude_deg)
        (albedo,) = cover.reflectance([number])
        return np.minimum(albedo * irradiance, MOST_SUN * seen)


def _nodes(
    imagery: Imagery, bands: list[Band]
) -> Float[np.ndarray, "rows columns bands"] | None:
    if not bands:
        return None
    return np.stack([imagery.background.radiance[b.number] for b in bands], axis=-1)
