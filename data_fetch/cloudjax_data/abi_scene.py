"""The bands of one scan belong together."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np
import xarray as xr

from cloudjax.geometry.fixed_grid import FixedGrid

from .abi import AbiBand
from .abi_name import SAME_SCAN
from .calibration import ReflectiveCalibration
from .errors import DataError
from .grid_mapping import GRID_MAPPING, fixed_grid_coordinates


@dataclass(frozen=True, eq=False)
class AbiScene:
    """An `AbiScene` is what one satellite saw in one scan.

    **Fields:**

    - `bands`: by band number. Raises `DataError` if there is none, or if they come
        from different satellites, sectors, scans or projections.
    """

    bands: dict[int, AbiBand]

    def __post_init__(self):
        if not self.bands:
            raise DataError("A scene needs at least one band: ask for one.")
        first, *others = self.bands.values()
        for other in others:
            _require_same_scan(first, other)

    @property
    def platform(self) -> str:
        """Name the satellite: "G16" ..."""
        return self._any.platform

    @property
    def sector(self) -> str:
        """Name the sector: "F", "C", "M1" or "M2"."""
        return self._any.sector

    @property
    def notes(self) -> tuple[str, ...]:
        """Give the sentences on what had to be assumed of the bands."""
        said = (note for band in self.bands.values() for note in band.notes)
        return tuple(dict.fromkeys(said))

    @property
    def start(self) -> datetime:
        """Give the time at which the first band started."""
        return min(band.start for band in self.bands.values())

    @property
    def end(self) -> datetime:
        """Give the time at which the last band ended."""
        return max(band.end for band in self.bands.values())

    @property
    def time(self) -> datetime:
        """Give the middle of the scan, in UTC."""
        return self.start + (self.end - self.start) / 2

    @property
    def grid(self) -> FixedGrid:
        """Give the grid that all bands share.

        Raises `DataError` if they do not: call `on_common_grid` first.
        """
        grid = self._any.grid
        if all(grid.same_as(band.grid) for band in self.bands.values()):
            return grid
        raise DataError(
            f"The bands read from {self._any.path.parent} have different resolutions: "
            "bring them onto a common grid first."
        )

    def on_common_grid(self, bands: Iterable[int] | None = None) -> "AbiScene":
        """Average the bands, in radiance, onto the coarsest of their grids.

        A block is good only if all of its pixels are. Raises `DataError` if a band is
        absent or if the grids do not nest within `SAME_CENTRE_RAD` of
        `cloudjax.geometry.fixed_grid`.
        """
        wanted = sorted(self.bands if bands is None else set(bands))
        absent = [number for number in wanted if number not in self.bands]
        if absent:
            raise DataError(
                f"The scene from {self._any.path.parent} was read without bands "
                f"{absent}: it has {sorted(self.bands)}, read the others too."
            )
        chosen = AbiScene({number: self.bands[number] for number in wanted}).bands
        coarsest = max(chosen.values(), key=lambda band: band.grid.step_rad).grid
        return AbiScene({n: _averaged(b, coarsest) for n, b in chosen.items()})

    @property
    def _any(self) -> AbiBand:
        return next(iter(self.bands.values()))


def to_dataset(scene: AbiScene) -> xr.Dataset:
    """Make a CF-1.8 Dataset with `radiance_C01` ... on `(y, x)`, for bands of one grid.

    NaN where not good. Raises `DataError` if the bands differ in resolution.
    """
    coordinates = fixed_grid_coordinates(scene.grid)
    coordinates["t"] = xr.DataArray(
        np.datetime64(scene.time.astimezone(UTC).replace(tzinfo=None), "ns"),
        attrs={"standard_name": "time", "long_name": "middle of the scan, UTC"},
    )
    bands = sorted(scene.bands.items())
    return xr.Dataset(
        {f"radiance_C{number:02d}": _radiance_array(band) for number, band in bands},
        coords=coordinates,
        attrs={
            "Conventions": "CF-1.8",
            "title": "ABI radiances",
            "platform_ID": scene.platform,
            "orbital_slot": bands[0][1].orbital_slot,
            "scene_id": scene.sector,
            "time_coverage_start": scene.start.isoformat(),
            "time_coverage_end": scene.end.isoformat(),
        },
    )


def _radiance_array(band: AbiBand) -> xr.DataArray:
    reflective = isinstance(band.calibration, ReflectiveCalibration)
    per = "wavelength" if reflective else "wavenumber"
    array = xr.DataArray(
        band.radiance,
        dims=("y", "x"),
        attrs={
            "standard_name": f"toa_outgoing_radiance_per_unit_{per}",
            "long_name": f"radiance of ABI band {band.number}",
            "units": band.units,
            "wavelength_um": band.wavelength_um,
        },
    )
    array.encoding["grid_mapping"] = GRID_MAPPING
    return array


def _averaged(band: AbiBand, grid: FixedGrid) -> AbiBand:
    if band.grid.same_as(grid):
        return band
    factor = max(round(grid.step_rad / band.grid.step_rad), 1)
    rows, columns = grid.shape
    nests = band.grid.shape == (rows * factor, columns * factor)
    if not nests or not band.grid.coarsened(factor).same_as(grid):
        raise DataError(
            f"The pixels of {band.path} do not nest in those of the coarsest band: "
            "read files of one sector and scan."
        )
    blocks = (rows, factor, columns, factor)
    good = band.good.reshape(blocks).all(axis=(1, 3))
    # in float64, because summing counts of equal size in float32 loses the last digits
    mean = band.radiance.reshape(blocks).mean(axis=(1, 3), dtype=np.float64)
    radiance = np.where(good, mean, np.nan).astype(np.float32)
    return replace(band, radiance=radiance, good=good, grid=grid)


def _require_same_scan(a: AbiBand, b: AbiBand) -> None:
    same = (
        (a.platform, a.sector) == (b.platform, b.sector)
        and abs(a.start - b.start) < SAME_SCAN
        and a.grid.same_projection_as(b.grid)
    )
    if not same:
        raise DataError(
            f"{a.path} ({a.platform} {a.sector} {a.start:%Y-%m-%d %H:%M:%S}) and "
            f"{b.path} ({b.platform} {b.sector} {b.start:%Y-%m-%d %H:%M:%S}) are not "
            "of one scan: keep one scan in a folder."
        )
