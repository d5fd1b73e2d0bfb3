"""Skies: from the renderer's scene to boards, textures and what is known of them."""

import functools as ft
import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from jaxtyping import Float, UInt8
from matplotlib.image import imsave

import cloudjax
from cloudjax import Scene
from cloudjax.particles.detail import LevelOfDetail
from cloudjax_data import DataError

from .atlas import atlas_of, coarse_colours
from .boards import Boards, boards_of
from .box import UP, Box, Picture, Sector, sectors
from .colours import Exposure, cloud_colours, ground_colours
from .document import Level, Sky
from .meshes import Mesh, Tiles, board_meshes, ground_mesh
from .sections import cloud_numbers, scattered, section_places, share_out
from .seen_cloud import SeenCloud, near_by, see_cloud
from .voxels import Voxels, require_voxels, voxels_of


TEXTURES = "textures"
# Below this the sun lights no cloud from above.
_LOWEST_SUN_DEG = 5.0
# Of a screen: pixels over the angle that they span.
_PIXELS_PER_RAD = 1000.0
# Optical depth that a byte of opacity can still tell from more.
_DEEPEST = 5.0


@dataclass(frozen=True)
class ExportSettings:
    """`ExportSettings` say how a sky is cut into boards.

    **Fields:**

    - `boards`: at most, at the finest level of detail and for each sector.
    - `pixels`: of all boards together, across the box; by default as many as eight
      for each board along each axis, were they side by side.
    - `azimuths`: sectors around the sky, besides the one from above.
    - `coarser`: of each level of detail, pixels that become one.
    - `tiles`: along each edge, which turn to the viewer one by one.
    - `seed`: of the particles.
    - `volume`: voxels along each edge of the box; None for none.

    **Raises:** `DataError` for numbers that are none.
    """

    boards: int = 1000
    pixels: int | None = None
    azimuths: int = 8
    coarser: tuple[int, ...] = (1, 2, 4)
    tiles: int = 4
    seed: int = 0
    volume: int | None = None

    def __post_init__(self):
        least = {"boards": 1, "pixels": 16, "azimuths": 3, "tiles": 1, "seed": 0}
        for name, low in least.items():
            value = getattr(self, name)
            if value is not None and value < low:
                raise DataError(f"{name} = {value} is too few: make it {low} or more.")
        if self.volume is not None:
            require_voxels(self.volume, self.across)

    @property
    def across(self) -> int:
        """Pixels across the box."""
        if self.pixels is not None:
            return self.pixels
        return int(np.clip(8 * math.sqrt(self.boards) // 8 * 8, 64, 768))


@dataclass(frozen=True, eq=False)
class Sight:
    """A `Sight` is a scene to be shown, and what is known of it.

    **Fields:**

    - `scene`: of reflective bands of ABI.
    - `box`: of it.
    - `time`, `sun_direction`: of the light.
    - `sources`: names of files.
    - `notes`: sentences for those who use it.
    - `kind`: what the clouds are, in words.
    - `extinction_share`: of the physical extinction that the scene calls extinction.
    """

    scene: Scene
    box: Box
    time: datetime
    sun_direction: Float[np.ndarray, "3"]
    sources: Sequence[str] = ()
    notes: Sequence[str] = ()
    kind: str = "clouds"
    extinction_share: float = 1.0

    @property
    def sun_deg(self) -> tuple[float, float]:
        """Azimuth and elevation of the sun over the centre of the box."""
        east, north, up = self.box.axes @ self.sun_direction
        azimuth = np.degrees(np.arctan2(east, north)) % 360
        return float(azimuth), float(np.degrees(np.arcsin(np.clip(up, -1, 1))))


@dataclass(frozen=True, eq=False)
class MadeSky:
    """A `MadeSky` is ready to be written.

    **Fields:**

    - `sky`: what documents show.
    - `images`: PNG files by their addresses.
    - `manifest`: what is known of it.
    - `from_above`: all boards of the sector from above, None where there are none.
    - `voxels`: None where none are asked for.
    """

    sky: Sky
    images: Mapping[str, bytes]
    manifest: Mapping
    from_above: Mesh | None = None
    voxels: Voxels | None = None


def make_sky(
    sight: Sight,
    settings: ExportSettings,
    on_tile: Callable[[int, int], None] | None = None,
) -> MadeSky:
    """Turn the clouds of a scene into boards.

    **Arguments:** `on_tile`: called with the numbers of rays done and of all, about.

    **Raises:** `DataError` where there is no cloud or no sun, and for too few boards.
    """
    if sight.sun_deg[1] < _LOWEST_SUN_DEG:
        raise DataError(
            f"The sun stands {sight.sun_deg[1]:.0f} degrees over the box at "
            f"{sight.time:%Y-%m-%d %H:%M} UTC and lights no cloud: give another "
            "--time, or a --sun."
        )
    work = _Work(sight, settings, on_tile)
    parts = {sector.name: work.sector(sector) for sector in work.sectors}
    images = {
        _address(i, name): image
        for name, part in parts.items()
        for i, image in enumerate(part.images)
    }
    ground = f"{TEXTURES}/ground.png"
    images[ground] = _png(work.ground)
    manifest = _manifest(work, {n: p.measured for n, p in parts.items()})
    box = sight.box
    sky = Sky(
        box=box,
        sectors=work.sectors,
        levels=[_level(work, parts, i) for i in range(len(settings.coarser))],
        ground=ground_mesh(box),
        ground_texture=ground,
        top_m=work.heights_m[1],
        about=_about(sight, manifest),
    )
    return MadeSky(sky, images, manifest, parts[UP.name].whole, work.voxels)


@dataclass(frozen=True, eq=False)
class _Part:
    """What a sector adds, level by level; and all boards of the finest as one mesh."""

    meshes: Sequence[Mapping[int, Mesh]]
    images: Sequence[bytes]
    measured: Mapping
    whole: Mesh | None


def _level(work: "_Work", parts: Mapping[str, _Part], i: int) -> Level:
    """The level of detail of this number, of all sectors."""
    return Level(
        tiles=work.tiles[i],
        meshes={
            (number, name): mesh
            for name, part in parts.items()
            for number, mesh in part.meshes[i].items()
        },
        textures={name: _address(i, name) for name in parts},
        from_m=work.from_m(i),
    )


class _Work:
    """What all sectors share."""

    def __init__(self, sight: Sight, settings: ExportSettings, on_tile):
        self.sight, self.settings = sight, settings
        self._told, self._on_tile = 0, on_tile
        self.scene = near_by(sight.scene)
        self.numbers = self.scene.bands
        self.sectors = sectors(settings.azimuths)
        self.exposure = Exposure.of_sun(math.sin(math.radians(sight.sun_deg[1])))
        shell = self.scene.shell
        self.above = self._see(UP, (shell.bottom_m, shell.top_m))
        first = section_places(self.above, settings.boards, settings.seed)
        # As many as the squares of lengths, for boards are areas.
        law = LevelOfDetail(1.0, power=2.0)
        shares = law.share(np.array(settings.coarser, float))
        more = [
            scattered(self.above, max(round(settings.boards * s), 1), settings.seed)
            for s in shares[1:]
        ]
        self.places = [first, *more]
        altitude = sight.box.altitude_m(self.above.place)
        self.heights_m = float(altitude.min()), float(altitude.max())
        # Steps have a length, and cloud reaches beyond their middles.
        margin = 0.05 * (shell.top_m - shell.bottom_m)
        self._framed_m = self.heights_m[0] - margin, self.heights_m[1] + margin
        self.ground = ground_colours(self.above, self.numbers, self.exposure)
        self.tiles = [
            Tiles(sight.box, max(settings.tiles // n, 1)) for n in settings.coarser
        ]

    @ft.cached_property
    def voxels(self) -> Voxels | None:
        if self.settings.volume is None:
            return None
        return voxels_of(self.above, self.settings.volume)

    @property
    def pitch_m(self) -> float:
        return self.sight.box.size_m / self.settings.across

    def from_m(self, level: int) -> float:
        """From where on a texel of the level is as small as a pixel of a screen."""
        return self.pitch_m * self.settings.coarser[level] * _PIXELS_PER_RAD

    def _see(self, sector: Sector, heights_m: tuple[float, float]) -> SeenCloud:
        picture = Picture.of(self.sight.box, sector, self.pitch_m, heights_m)
        seen = see_cloud(
            self.scene,
            picture,
            self.sight.sun_direction,
            extinction_share=self.sight.extinction_share,
            on_tile=self._tell,
        )
        if not (np.isfinite(seen.cloudy).all() and np.isfinite(seen.depth).all()):
            raise DataError(
                "The clouds of the box have values that are not finite: check the data."
            )
        return seen

    def _tell(self, done: int, of: int) -> None:
        if self._on_tile is not None:
            # Sectors to come are taken for as large as this one.
            share = (self._told + done / of) / len(self.sectors)
            self._on_tile(round(1000 * share), 1000)
        self._told += done == of

    def sector(self, sector: Sector) -> _Part:
        """Make the boards of a sector."""
        seen = self.above if sector is UP else self._see(sector, self._framed_m)
        colours = cloud_colours(seen, self.numbers, self.exposure)
        meshes, images, made, whole = [], [], [], None
        for places, coarser, tiles in zip(
            self.places, self.settings.coarser, self.tiles, strict=True
        ):
            sections = share_out(seen, places)
            boards = boards_of(seen.picture, sections, coarser)
            atlas = atlas_of(boards, coarse_colours(colours, coarser))
            if not made:
                every = board_meshes(boards, atlas, Tiles(self.sight.box, 1))
                whole = dict(every).get(0)
            meshes.append(dict(board_meshes(boards, atlas, tiles)))
            images.append(_png(atlas.image))
            made.append(boards)
        return _Part(meshes, images, _measured(seen, made), whole)


def _measured(seen: SeenCloud, levels: Sequence[Boards]) -> Mapping:
    """Opacities and depths of the boards as they are written, beside the source's."""
    depth = seen.column_depth
    opacity = -np.expm1(-depth)
    opacities = [level.opacity() for level in levels]
    boards = opacities[0]
    return {
        "azimuth_deg": seen.picture.sector.azimuth_deg,
        "elevation_deg": seen.picture.sector.elevation_deg,
        "boards": [len(level.boards) for level in levels],
        "mean_opacity": {
            "source": _round(opacity.mean()),
            "boards": [_round(each.mean()) for each in opacities],
        },
        "mean_optical_depth_up_to_5": {
            "source": _round(np.minimum(depth, _DEEPEST).mean()),
            "boards": _round(
                np.minimum(-np.log(np.maximum(1 - boards, 1e-9)), _DEEPEST).mean()
            ),
        },
        "greatest_difference_of_opacity": _round(
            np.abs(boards.reshape(-1) - opacity).max()
        ),
    }


def _manifest(work: _Work, measured: Mapping[str, Mapping]) -> Mapping:
    sight, settings, box = work.sight, work.settings, work.sight.box
    azimuth, elevation = sight.sun_deg
    return {
        "made_by": f"cloudjax {cloudjax.__version__}",
        "what": sight.kind,
        "sources": list(sight.sources),
        "notes": list(sight.notes),
        "time": sight.time.isoformat(),
        "centre_deg": [box.latitude_deg, box.longitude_deg],
        "size_m": box.size_m,
        "cloud_m": [round(z) for z in work.heights_m],
        "sun": {"azimuth_deg": _round(azimuth), "elevation_deg": _round(elevation)},
        "clouds": cloud_numbers(work.above)[1],
        "mean_optical_depth": _round(work.above.column_depth.mean()),
        "boards": settings.boards,
        "texel_m": [_round(work.pitch_m * n) for n in settings.coarser],
        "levels_from_m": [round(work.from_m(i)) for i in range(len(settings.coarser))],
        "seed": settings.seed,
        "sectors": dict(measured),
        **_of_volume(work),
        "files": {
            "scene.x3d": "plain transforms: metres, x east, y up, z south",
            "scene_geo.x3d": "the same on the globe, by GeoLocation (WGS 84)",
            "scene.glb": "the boards from above as glTF; the same axes",
            "viewer.html": "the same with its textures, for x3dom.js beside it",
        },
    }


def _of_volume(work: _Work) -> Mapping:
    voxels = work.voxels
    if voxels is None:
        return {}
    return {
        "volume": {
            "voxels": voxels.depth.shape[0],
            "size_m": [round(size) for size in voxels.size_m],
            "mean_optical_depth": _round(voxels.depth.sum(axis=0).mean()),
            "slice_m": _round(voxels.slice_m),
            "mean_opacity": _round(voxels.mean_opacity()),
        }
    }


def _about(sight: Sight, manifest: Mapping) -> Mapping[str, str]:
    box, sun = sight.box, manifest["sun"]
    return {
        "title": f"Clouds of {sight.time:%Y-%m-%d %H:%M} UTC",
        "description": f"{sight.kind}, {box.size_m / 1e3:g} km about "
        f"{box.latitude_deg:g}, {box.longitude_deg:g}; sun at azimuth "
        f"{sun['azimuth_deg']:.0f}, elevation {sun['elevation_deg']:.0f} degrees",
        "source": ", ".join(sight.sources),
        "generator": manifest["made_by"],
    }


def _address(level: int, sector: str) -> str:
    return f"{TEXTURES}/level{level}_{sector}.png"


def _round(value: float) -> float:
    return float(f"{value:.5g}")


def _png(image: UInt8[np.ndarray, "height width channels"]) -> bytes:
    file = io.BytesIO()
    imsave(file, image, format="png")
    return file.getvalue()
