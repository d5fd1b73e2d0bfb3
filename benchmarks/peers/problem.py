"""The scene of the paper's Table 3: a full disc through one shell of low cloud."""

import dataclasses
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from cloudjax import (
    FixedGrid,
    GivenOptics,
    Latent,
    Layer,
    MaskGrid,
    Rays,
    ReflectiveBands,
    Scene,
    TwoFlux,
    UniformGround,
    cloud_classes,
)
from cloudjax.geometry.geodesy import up

from .straight import StraightCloud, periods_m, straight, textures
from .work import Clouds, Mask, Work


CLASS, SEED = "low_cumulus", 0
LONGITUDE_DEG = 0.0
# Over the south Atlantic: day in the west and in the middle, night in the east.
SUN = up(np.array(-21.0), np.array(-30.0))
INDIRECT = 0.3
# Of the physical extinction, what the paper's slab calls extinction
# (docs/theory/paper.md).
SHARE = (1 - 0.85) / 2


@dataclass(frozen=True, eq=False)
class Problem:
    """A picture, as small numbers that every process can make it from.

    **Fields:**

    - `pixels`: per side of the full disc.
    - `voxels`: per axis of the peers' textures.
    - `steps`: of the peers through the shell.
    - `fraction`: of low cloud, [lat lon], ascending from pole to pole and from 0 E.
    - `extinction_per_m`: of the cloud; None for that of the class.
    """

    pixels: int
    voxels: int
    steps: int
    fraction: np.ndarray
    extinction_per_m: float | None = None

    def grid(self, parts: int = 1) -> FixedGrid:
        """The full disc, each pixel cut into parts²."""
        whole = FixedGrid.abi_full_disc(10.0, LONGITUDE_DEG)
        width = abs(float(whole.x_rad[1] - whole.x_rad[0])) * len(whole.x_rad)
        count = self.pixels * parts
        axis = ((np.arange(count) + 0.5) / count - 0.5) * width
        return dataclasses.replace(whole, x_rad=axis, y_rad=-axis)

    def sub_rays(self, pixels: np.ndarray, parts: int) -> Rays:
        """The parts² rays of each of these pixels, one pixel after the other."""
        row, column = np.divmod(pixels, self.pixels)
        a, b = np.divmod(np.arange(parts**2), parts)
        rows, columns = (
            (first[:, None] * parts + second).ravel()
            for first, second in ((row, a), (column, b))
        )
        return self.grid(parts).rays(rows * self.pixels * parts + columns)

    @property
    def mask(self) -> MaskGrid:
        rows, columns = self.fraction.shape
        latitude = np.linspace(-90, 90, rows)
        return MaskGrid.from_fraction(
            self.fraction, latitude, np.arange(columns) * (360 / columns)
        )

    def work(self, rays: Rays) -> Work:
        """The same for the peers."""
        cloud, mask = self.cloud(), self.mask
        lat, lon = mask.grid.latitude, mask.grid.longitude
        there = Mask(np.array(mask.mask), (lat.first, lon.first), (lat.step, lon.step))
        return Work(
            origin_m=np.array(rays.origin_m[0]),
            direction=rays.direction.astype(np.float32),
            sun=SUN,
            indirect=INDIRECT,
            clouds=clouds_of(cloud, there, self._extinction_per_m(CLASS), self.voxels),
            steps=self.steps,
        )

    def cloud(self, name: str = CLASS) -> StraightCloud:
        """A class, with as many octaves as the voxels can hold."""
        return straight(cloud_classes()[name].cloud(SEED), self.voxels)

    def scene(self, steps: int, nodes: int, layers: int = 1, bands: int = 1) -> Scene:
        """The same for cloudjax, in bands whose radiance is the reflectance.

        Further layers are the paper's other classes, under the same mask. Nothing is
        seen behind them.
        """
        names = [CLASS, *(name for name in cloud_classes() if name != CLASS)]
        white, one = jnp.zeros(bands), jnp.ones(bands)
        changes = {"latent": Latent.equal_shares(nodes), "mask": self.mask}
        return Scene(
            layers=tuple(
                Layer(
                    cloud=dataclasses.replace(self.cloud(name), **changes),
                    extinction_per_m=jnp.asarray(self._extinction_per_m(name)),
                    optics=GivenOptics(
                        infrared_ratio=jnp.asarray(0.0),
                        co_albedo=white,
                        relative_absorption=jnp.zeros(0),
                    ),
                    name=name,
                    steps=steps,
                )
                for name in names[:layers]
            ),
            reflective=ReflectiveBands(tuple(range(1, bands + 1)), one, white, one),
            emissive=None,
            reflection=TwoFlux(jnp.asarray(INDIRECT)),
            ground=UniformGround(albedo=0.0),
        )

    def _extinction_per_m(self, name: str) -> float:
        if self.extinction_per_m is not None:
            return self.extinction_per_m
        return SHARE * cloud_classes()[name].extinction_per_m


def clouds_of(
    cloud: StraightCloud, mask: Mask, extinction_per_m: float, voxels: int
) -> Clouds:
    """A cloud of cloudjax for its peers, with textures of points."""
    f = cloud.function
    return Clouds(
        voxels=textures(cloud, voxels),
        period_m=periods_m(cloud),
        weight=tuple(float(m) for m in f.weights),
        mask=mask,
        mask_gain=float(f.mask_gain),
        threshold=float(f.threshold),
        base_m=float(f.base_m),
        top_m=float(f.top_m),
        barrier_scale_m=float(f.barrier_scale_m),
        bottom_m=cloud.shell.bottom_m,
        ceiling_m=cloud.shell.top_m,
        extinction_per_m=extinction_per_m,
    )


def generated_fraction() -> np.ndarray:
    """Waves of weather where there is no analysis, a third of it cloudy."""
    latitude = np.radians(np.linspace(-90, 90, 73))[:, None]
    longitude = np.radians(np.arange(0, 360, 2.5))[None]
    waves = sum(
        np.cos(m * longitude + n * latitude + m * n)
        for m, n in ((2, 5), (3, -7), (5, 11), (7, -4))
    )
    return np.clip(0.33 + 0.25 * waves * np.cos(latitude) ** 2, 0, 1)
