"""What the ground is by place: sea, lakes, forest, grass and crops, soil, sand and ice.

The shares of kinds are NASA's (MODIS land cover, and the Blue Marble for how bright
bare ground is; `tools/make_ground_cover.py`). Each kind has a spectrum, of round
numbers within what is published:

- sea and lakes: Fresnel's reflection of skylight, whitecaps, and light from below in
  the blue.
- forest, and grass and crops: like the means of their classes in the albedo of MODIS
  (Moody et al. 2005, IEEE Trans. Geosci. Remote Sens. 43, 144); 0.47 and 0.64 µm of
  forest are near the quarter and the half of 2.2 µm that Kaufman et al. (1997, ibid.
  35, 1286) find over dark vegetation.
- sand: as bright as the sites of the Sahara that satellites are calibrated by
  (Cosnefroy et al. 1996, Remote Sens. Environ. 58, 101); soil: dark, as in the
  ECOSTRESS spectral library (Baldridge et al. 2009, Remote Sens. Environ. 113, 711;
  Meerdink et al. 2019, ibid. 230, 111196).
- snow and ice: bright in the visible, about 0.05 at 2.13 µm (Moody et al. 2007, Remote
  Sens. Environ. 111, 337).
- 3.9 µm: one less the emissivity of sea (Masuda et al. 1988, Remote Sens. Environ. 24,
  313), plants and soil (Seemann et al. 2008, J. Appl. Meteorol. Climatol. 47, 108) and
  snow (Dozier & Warren 1982, Water Resour. Res. 18, 1219).
- 8.4 to 13.3 µm: the quartz of sand emits less at 8 to 9.6 µm (Seemann et al. 2008).
  Water, plants and snow lack 0.01 to 0.02 of one, which the sky above gives back in
  part; no sky is mirrored here, so they are black.
"""

import functools as ft
import importlib.resources
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from cloudjax.geometry.latlon_grid import LatLonGrid
from cloudjax.light.optics import LAST_SUNLIT_BAND


# Bands 1 to 7: 0.47, 0.64, 0.87, 1.38, 1.61, 2.25 and 3.9 µm.
SEA = (0.045, 0.030, 0.015, 0.010, 0.008, 0.005, 0.02)
FOREST = (0.02, 0.03, 0.27, 0.18, 0.14, 0.06, 0.03)
HERBS = (0.04, 0.065, 0.30, 0.26, 0.23, 0.12, 0.05)
SOIL = (0.05, 0.09, 0.15, 0.20, 0.23, 0.21, 0.12)
SAND = (0.24, 0.45, 0.56, 0.62, 0.65, 0.57, 0.30)
SNOW = (0.80, 0.80, 0.70, 0.40, 0.10, 0.05, 0.03)
# Bands 8 to 16: 6.2, 6.9, 7.3, 8.4, 9.6, 10.3, 11.2, 12.3 and 13.3 µm.
SOIL_EMITS = (0.96, 0.96, 0.96, 0.93, 0.94, 0.96, 0.97, 0.98, 0.98)
SAND_EMITS = (0.95, 0.95, 0.95, 0.78, 0.82, 0.92, 0.95, 0.97, 0.97)
# Kinds of ground, in the order of `Ground.shares`: water of sea and lakes is alike.
_SPECTRA = np.array([SEA, FOREST, SOIL, SAND, SNOW, HERBS]).T
_BLACK = (1.0,) * 9
_EMITS = np.array([_BLACK, _BLACK, SOIL_EMITS, SAND_EMITS, _BLACK, _BLACK]).T
# Trees hide snow: forests under it have an albedo of 0.3 to 0.4 (Moody et al. 2007).
SEEN_UNDER_TREES = 0.4

_LAND_CELL_DEG, _LAND_LEVELS = 0.1, 15
_CELL_DEG, LEVELS = 0.2, 15


@dataclass(frozen=True, eq=False)
class GroundCover:
    """A `GroundCover` is a table of land, and of what the land is.

    **Fields:**

    - `land_share`: 0 at sea, 1 on land, at the nodes of `land_grid`; lakes are land.
    - `kinds`: how much of the land is lakes, forest, soil, sand and ice, at the nodes
      of `grid`; the rest is grass and crops.
    """

    land_share: Float[np.ndarray, "rows columns"]
    land_grid: LatLonGrid
    kinds: Float[np.ndarray, "5 lat lon"]
    grid: LatLonGrid

    def land_at(
        self,
        latitude_deg: Float[np.ndarray, " points"],
        longitude_deg: Float[np.ndarray, " points"],
    ) -> Float[np.ndarray, " points"]:
        """Interpolate the share of land; between 0 and 1 within 11 km of a coast."""
        places = latitude_deg, longitude_deg
        return np.asarray(self.land_grid.sample_all([self.land_share], *places)[0])

    def at(
        self,
        latitude_deg: Float[np.ndarray, " points"],
        longitude_deg: Float[np.ndarray, " points"],
    ) -> "Ground":
        """Interpolate the shares of the kinds to places, bilinear."""
        land = self.land_at(latitude_deg, longitude_deg)
        shares = np.zeros((len(_SPECTRA.T), len(land)))
        shares[0] = 1 - land
        # Most of what is seen of the Earth is sea.
        on = np.flatnonzero(land)
        if len(on):
            places = latitude_deg[on], longitude_deg[on]
            kinds = np.stack(self.grid.sample_all([*self.kinds], *places))
            for share, kind in zip(shares, [*kinds, 1 - kinds.sum(0)], strict=True):
                share[on] += land[on] * kind
        return Ground(land, shares)


@dataclass(frozen=True, eq=False)
class Ground:
    """A `Ground` is what some places are, apart from the weather.

    **Fields:**

    - `land`: share of land, lakes included.
    - `shares`: of water, forest, soil, sand, ice, and grass and crops.
    """

    land: Float[np.ndarray, " points"]
    shares: Float[np.ndarray, "6 points"]

    @property
    def water(self) -> Float[np.ndarray, " points"]:
        """Give the share of sea and lakes."""
        return self.shares[0]

    @property
    def forest(self) -> Float[np.ndarray, " points"]:
        """Give the share of forest."""
        return self.shares[1]

    def reflectance(self, bands: Sequence[int]) -> Float[np.ndarray, "bands points"]:
        """Give the Lambertian albedo in bands that see the sun, numbers 1 to 7."""
        return _SPECTRA[[band - 1 for band in bands]] @ self.shares

    def emissivity(self, bands: Sequence[int]) -> Float[np.ndarray, "bands points"]:
        """Give the emissivity in bands that do not see the sun, numbers 8 to 16."""
        return _EMITS[[band - LAST_SUNLIT_BAND - 1 for band in bands]] @ self.shares


@ft.cache
def ground_cover() -> GroundCover:
    """Return the table that is shipped."""
    packed = _read("land_share.npz", "share")
    level = np.stack([packed >> 4, packed & 15], axis=-1).reshape(len(packed), -1)
    share = (level / np.float32(_LAND_LEVELS)).astype(np.float32)
    kinds = _read("ground_cover.npz", "shares") / np.float32(LEVELS)
    return GroundCover(
        share,
        _cells(share.shape, _LAND_CELL_DEG),
        kinds,
        _cells(kinds.shape[1:], _CELL_DEG),
    )


def _read(name: str, field: str) -> np.ndarray:
    file = importlib.resources.files("cloudjax_scenes") / name
    with file.open("rb") as stream, np.load(stream) as content:
        return content[field]


def _cells(shape: tuple[int, ...], cell_deg: float) -> LatLonGrid:
    """The middles of cells all over the Earth."""
    rows, columns = shape
    return LatLonGrid.from_axes(
        cell_deg * (np.arange(rows) + 0.5) - 90,
        cell_deg * (np.arange(columns) + 0.5) - 180,
    )
