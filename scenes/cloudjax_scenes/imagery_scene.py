"""A scene made from imagery: only what the imagery shows is built.

There is no cirrus without a window band, and no air and no sunlight in bands that are
not asked.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from cloudjax import (
    Air,
    Band,
    BandRadiances,
    CloudClass,
    EmissiveBands,
    LatLonGrid,
    MaskGrid,
    Rays,
    ReflectiveBands,
    Scene,
    StandardAtmosphere,
    Weather,
    class_layer,
)
from cloudjax.air.clear_air import rayleigh
from cloudjax.geometry.geodesy import up
from cloudjax_data import DataError, sun_direction

from .imagery import Imagery
from .lights import PAPER, Light
from .surface import Surface
from .weather_analysis import Analysis


# At most so much of a clear radiance at 3.9 µm is the sun's, or nothing would be warm.
MOST_SUN = 0.8


@dataclass(frozen=True, eq=False)
class SceneFromImagery:
    """What a scene is built of where imagery tells where clouds are.

    **Fields:**

    - `imagery`: where clouds stand, and what is seen without them.
    - `analysis`: the weather of that hour: winds that draw the textures, temperatures
      and humidities; None for still air and the standard atmosphere.
    - `light`: the strategy for light.
    - `known`: classes of cloud by name; None for those of the light.
    - `seed`: of all textures; `steps`: of the march through each shell.
    """

    imagery: Imagery
    analysis: Analysis | None = None
    light: Light = PAPER
    known: Mapping[str, CloudClass] | None = None
    seed: int = 0
    steps: int = 24

    def __post_init__(self):
        missing = [
            name for name in self.imagery.fractions if name not in self.available
        ]
        if missing:
            raise DataError(
                f"{self.imagery.name} has clouds of the class {missing[0]}, which is "
                f"not among {', '.join(self.available)}: add it to the file of classes."
            )

    @property
    def classes(self) -> tuple[CloudClass, ...]:
        """Those that the imagery shows, one for each layer."""
        return tuple(self.available[name] for name in self.imagery.fractions)

    @property
    def available(self) -> Mapping[str, CloudClass]:
        """All classes that the scene may have, by name."""
        return self.light.imagery_classes() if self.known is None else self.known

    def build(self) -> Scene:
        """Build the scene, at the values of the classes."""
        imagery, light = self.imagery, self.light
        temperature, humidity = (
            (StandardAtmosphere(jnp.asarray(0.0)), None)
            if self.analysis is None
            else self.analysis.air(imagery)
        )
        sunlit, emissive = imagery.sunlit, imagery.emissive
        layers = tuple(
            class_layer(
                one,
                sunlit=[band.number for band in sunlit],
                thermal=[band.number for band in emissive],
                seed=self.seed + 100 * i,
                steps=self.steps,
                extinction_share=light.share,
                movable=True,
            )
            for i, one in enumerate(self.classes)
        )
        return Scene(
            layers=layers,
            reflective=ReflectiveBands.of(
                sunlit,
                imagery.earth_sun_distance_au,
                [path_reflectance(band, light) for band in sunlit],
            ),
            emissive=EmissiveBands.of(emissive),
            reflection=light.reflection(),
            emission=light.emission() if light.emission and emissive else None,
            temperature=temperature,
            air=Air.of_bands(tuple(imagery.bands), humidity) if light.air else None,
        )

    def weather(self) -> Weather:
        """Find where the clouds may stand, and how the winds have drawn them."""
        imagery = self.imagery
        masks = [
            MaskGrid.from_fraction(
                fraction, imagery.latitude_deg, imagery.longitude_deg
            )
            for fraction in imagery.fractions.values()
        ]
        if self.analysis is None:
            return Weather(masks)
        return Weather(masks, self.analysis.displacements(self.classes))

    def background(self, rays: Rays) -> BandRadiances:
        """Find what rays see without cloud.

        Clear pixels show what band 7 reflects and emits as one: by day the sun's part
        is that of the surface's table, and what is left is emission.
        """
        imagery = self.imagery
        ground, _ = rays.ground(imagery.grid.ellipsoid)
        place = ground.latitude_deg, ground.longitude_deg
        grid = LatLonGrid.from_axes(imagery.latitude_deg, imagery.longitude_deg)
        maps = np.stack([imagery.backgrounds[n] for n in imagery.bands], axis=-1)
        values = np.asarray(grid.sample(maps, *place)).T
        seen = dict(zip(imagery.bands, values, strict=True))
        sunlit = {
            band.number: seen[band.number]
            if band.reflective
            else self._reflected(band, seen[band.number], *place)
            for band in imagery.sunlit
        }
        emitted = {
            band.number: seen[band.number] - sunlit.get(band.number, 0.0)
            for band in imagery.emissive
        }
        return BandRadiances(_rows(sunlit), _rows(emitted))

    def _reflected(self, band: Band, seen, latitude_deg, longitude_deg):
        """The sun's part of a clear radiance, by the table of the surface."""
        vertical = up(latitude_deg, longitude_deg)
        height = np.maximum((vertical * sun_direction(self.imagery.time)).sum(-1), 0)
        (albedo,) = Surface().reflectance([band.number], latitude_deg, longitude_deg)
        reflected = albedo * height / self.imagery.coefficients(band.number)["kappa0"]
        return np.minimum(reflected, MOST_SUN * seen)


def path_reflectance(band: Band, light: Light) -> float:
    """Return the reflectance factor of the air where a path stands for it, else 0.

    Rayleigh scattering to first order, of the air above 850 hPa: phase function
    3/4 (1 + cos²Θ) near backscatter, over the cosines of two 50 degree slants.
    """
    if light.air:
        return 0.0
    τ = float(rayleigh.optical_depth(band.wavelength_um))
    return float(0.85 * τ * 1.5 / (4 * np.cos(np.radians(50))))


def _rows(parts: Mapping[int, np.ndarray]) -> Float[jnp.ndarray, "bands rays"] | None:
    return jnp.asarray(np.array(list(parts.values())), float) if parts else None
