"""The embedded mesoscale scene, for cloudjax and for its peers."""

import dataclasses

import numpy as np

from cloudjax import BandRadiances, Latent, MaskGrid, Rays, Scene, render
from cloudjax_data import sun_direction
from cloudjax_fit.embedded import embedded_target
from cloudjax_scenes import SceneFromImagery

from .ours import Sight
from .problem import clouds_of
from .straight import straight
from .work import Mask, Picture, Work


class Demo:
    """GOES-17, 2019-10-27, bands 1, 3 and 13, at the defaults of all parameters.

    **Fields:** `voxels`: per axis of the peers' textures.
    """

    def __init__(self, voxels: int):
        self.voxels = voxels
        self._made_of = SceneFromImagery(embedded_target().imagery)

    @property
    def count(self) -> int:
        rows, columns = self._made_of.imagery.grid.shape
        return rows * columns

    @property
    def sun(self) -> np.ndarray:
        return sun_direction(self._made_of.imagery.time)

    def rays(self) -> Rays:
        return self._made_of.imagery.grid.rays()

    def sub_rays(self, pixels: np.ndarray, parts: int) -> Rays:
        """The parts² rays of each of these pixels, one pixel after the other."""
        grid = self._made_of.imagery.grid
        a, b = (x.ravel() for x in np.divmod(np.arange(parts**2), parts))
        row, column = np.divmod(pixels, grid.shape[1])
        fine = dataclasses.replace(
            grid, x_rad=_cut(grid.x_rad, parts), y_rad=_cut(grid.y_rad, parts)
        )
        rows = (row[:, None] * parts + a).ravel()
        columns = (column[:, None] * parts + b).ravel()
        return fine.rays(rows * fine.shape[1] + columns)

    def sight(self) -> Sight:
        return Sight(self.rays, self.sun)

    def scene(self, steps: int, nodes: int) -> Scene:
        scene = dataclasses.replace(self._made_of, steps=steps).build()
        latent = Latent.equal_shares(nodes)
        layers = tuple(
            dataclasses.replace(
                layer,
                cloud=dataclasses.replace(
                    straight(layer.cloud, self.voxels), latent=latent
                ),
            )
            for layer in scene.layers
        )
        return dataclasses.replace(scene, layers=layers)

    def clear(self, rays: Rays) -> BandRadiances:
        """What the rays see without cloud."""
        bare = dataclasses.replace(self.scene(1, 1), layers=())
        return render(bare, rays, self.sun).radiances

    def picture(self, rays: Rays, steps: int) -> Picture:
        """The same for the peers, in reflectance factors and radiance."""
        scene, clear = self.scene(steps, 1), self.clear(rays)
        layers = sorted(scene.layers, key=lambda layer: layer.cloud.shell.bottom_m)
        works = tuple(
            Work(
                origin_m=np.array(rays.origin_m[0]),
                direction=rays.direction.astype(np.float32),
                sun=self.sun,
                indirect=float(scene.reflection.indirect),
                clouds=clouds_of(
                    layer.cloud,
                    around(layer.cloud.mask),
                    float(layer.extinction_per_m),
                    self.voxels,
                ),
                steps=steps,
            )
            for layer in layers
        )
        reflective, p = scene.reflective, scene.emissive
        return Picture(
            layers=works,
            depths_per_m=np.array(
                [[*layer.sunlit_per_m, layer.absorptions_per_m[0]] for layer in layers],
                np.float32,
            ),
            shares=np.array(
                [
                    1 - np.sqrt(1 - (1 - layer.optics.scatterers.co_albedo) ** 2)
                    for layer in layers
                ]
            ),
            planck=np.array([float(x[0]) for x in (p.fk1, p.fk2, p.bc1, p.bc2)]),
            air=np.array(reflective.path),
            behind=np.concatenate(
                [reflective.reflectance(clear.reflective), clear.emissive]
            ),
        )


def _cut(axis: np.ndarray, parts: int) -> np.ndarray:
    step = axis[1] - axis[0]
    return (axis[:, None] + step * ((np.arange(parts) + 0.5) / parts - 0.5)).ravel()


def around(mask: MaskGrid) -> Mask:
    """A regional mask on a grid round the Earth with the same nodes, the edges held."""
    lat, lon = mask.grid.latitude, mask.grid.longitude
    columns = round(360 / lon.step)
    first = lat.first - lat.step * int((lat.first + 90) / lat.step)
    rows = int((90 - first) / lat.step) + 1
    φ, λ = np.meshgrid(
        first + lat.step * np.arange(rows),
        lon.first + lon.step * np.arange(columns),
        indexing="ij",
    )
    values = np.asarray(mask(φ, λ), np.float32)
    return Mask(values, (first, lon.first), (lat.step, 360 / columns))
