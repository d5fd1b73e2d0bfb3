"""WRF output becomes columns: condensate, air and winds on the model's own levels."""

import functools as ft
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import netCDF4
import numpy as np
from jaxtyping import Float

from cloudjax.geometry.column_grid import ColumnGrid

from .condensate import SPECIES, Condensate, LevelAir, Species, joined
from .errors import DataError
from .packed import netcdf_file
from .wrf_grid import read_grid
from .wrf_times import WrfFrame


# WRF's own (share/module_model_constants.F).
GRAVITY_M_S2 = 9.81
_GAS_J_KG_K = 287.0
_VAPOUR_OVER_AIR = 461.6 / 287.0
_BASE_K, _BASE_PA = 300.0, 1e5
_EXPONENT = 2 / 7
_FREEZING_K = 273.15
# No number of WRF is larger.
_BEYOND = 1e30
# Number of the scheme of three species, MP_PHYSICS.
_WSM3 = 3
# Less condensate than this on any path through the file is none [g/m³].
LEAST_CONTENT = 1e-6

Cells = Float[np.ndarray, "levels y x"]


@dataclass(frozen=True, eq=False)
class WrfColumns:
    """`WrfColumns` are one time of a WRF run.

    **Fields:**

    - `frame`: time and file.
    - `grid`: where the columns are.
    - `heights_m`: of the levels' lower and upper ends above the sea, ascending.
    - `temperature_k`, `pressure_pa`: in the middle of the levels.
    - `vapour`: mixing ratio [kg/kg].
    - `air_kg_m3`: density of dry air, to which mixing ratios refer.
    - `condensate`: water, and ice where the file has any of it.
    - `cloud_fraction`: of the cells, 0 to 1; None where the file has none.
    - `winds_m_s`: to the true east, to the true north and upwards, in the middle of the
        cells; None where the file has not all three.
    - `ground_m`: height of the ground.
    - `levels_of_run`: as many as the run had, of which the file may hold fewer.
    """

    frame: WrfFrame
    grid: ColumnGrid
    heights_m: Float[np.ndarray, "ends y x"]
    temperature_k: Cells
    pressure_pa: Cells
    vapour: Cells
    air_kg_m3: Cells
    condensate: tuple[Condensate, ...]
    cloud_fraction: Cells | None
    winds_m_s: tuple[Cells, Cells, Cells] | None
    ground_m: Float[np.ndarray, "y x"]
    levels_of_run: int

    @property
    def time(self) -> datetime:
        """Give the time, in UTC."""
        return self.frame.time

    @property
    def sources(self) -> tuple[str, ...]:
        """Give the names of the files."""
        return (self.frame.path.name,)

    @property
    def air(self) -> LevelAir:
        """Give the air in the middle of the levels."""
        middle = (self.heights_m[1:] + self.heights_m[:-1]) / 2
        return LevelAir(middle, self.temperature_k, self.specific_humidity)

    @ft.cached_property
    def specific_humidity(self) -> Cells:
        """Give the mass of vapour over that of moist air."""
        return self.vapour / (1 + self.vapour)

    def require_cloud(self) -> None:
        """Raise `DataError` where there is no condensate at all."""
        if max(part.content_g_m3.max() for part in self.condensate) < LEAST_CONTENT:
            raise DataError(
                f"{self.frame.path} has no cloud at {self.time:%Y-%m-%d %H:%M}: choose "
                "another time."
            )

    def cautions(self) -> list[str]:
        """Say what the file does not hold and pictures of it will therefore lack."""
        said = []
        held, top = len(self.pressure_pa), self.pressure_pa[-1].mean() / 100
        if held < self.levels_of_run:
            said.append(
                f"The file has {held} of the run's {self.levels_of_run} levels, up to "
                f"{top:.0f} hPa: clouds above that are missing."
            )
        if "ice" not in [part.phase for part in self.condensate]:
            said.append("The file has no ice: all cloud in it is of water.")
        return said


def read_wrf(frame: WrfFrame, centre: tuple[float, float] | None = None) -> WrfColumns:
    """Read one time of a WRF run.

    **Arguments:**

    - `frame`: of `open_wrf`.
    - `centre`: latitude and longitude of the middle of an ideal run, which has no map.

    **Raises:** `DataError` where variables are missing (it names them), hold what is
    not a number, or do not make columns; and for places as `wrf_grid.read_grid` says.
    """
    with netcdf_file(frame.path) as file:
        return _columns(_Frame(frame, file), centre)


def _columns(of: "_Frame", centre) -> WrfColumns:
    of.require("PH", "PHB", "P", "PB", "T", "QVAPOR")
    places = (of["XLAT"], of["XLONG"]) if of.has("XLAT", "XLONG") else None
    grid = read_grid(of.path, of.file, places, centre)
    heights = (of["PH"] + of["PHB"]) / GRAVITY_M_S2
    if not (np.diff(heights, axis=0) > 0).all():
        raise DataError(
            f"{of.path} has levels that do not rise: its PH and PHB do not belong "
            "together, get the file again."
        )
    pressure, vapour = of["P"] + of["PB"], np.maximum(of["QVAPOR"], 0)
    kelvin = (of["T"] + _BASE_K) * (pressure / _BASE_PA) ** _EXPONENT
    air = pressure / (_GAS_J_KG_K * kelvin * (1 + _VAPOUR_OVER_AIR * vapour))
    fraction = np.clip(of["CLDFRA"], 0, 1) if of.has("CLDFRA") else None
    return WrfColumns(
        frame=of.frame,
        grid=grid,
        heights_m=heights,
        temperature_k=kelvin,
        pressure_pa=pressure,
        vapour=vapour,
        air_kg_m3=air,
        condensate=_condensate(of, air, kelvin),
        cloud_fraction=fraction,
        winds_m_s=_winds(of, grid) if of.has("U", "V", "W") else None,
        ground_m=of["HGT"] if of.has("HGT") else heights[0],
        levels_of_run=max(
            int(getattr(of.file, "BOTTOM-TOP_GRID_DIMENSION", 1)) - 1, len(pressure)
        ),
    )


def _condensate(of: "_Frame", air: Cells, kelvin: Cells) -> tuple[Condensate, ...]:
    held = [species for species in SPECIES if of.has(species.content)]
    if not held:
        raise DataError(
            f"{of.path} has no condensate: give a file with QCLOUD, and QICE, QSNOW, "
            "QGRAUP or QRAIN where the run has them."
        )
    parts: dict[str, list] = {}
    for species in held:
        # Advection leaves traces below nought.
        ratio = np.maximum(of[species.content], 0)
        number, radius = (
            of[name] if of.has(name) else None
            for name in (species.number, species.radius)
        )
        for kind, share in _by_phase(of, species, kelvin):
            radius_um = kind.radius_um(share * ratio, number, radius)
            part = 1e3 * air * share * ratio, radius_um
            parts.setdefault(kind.phase, []).append(part)
    return tuple(joined(phase, some) for phase, some in parts.items())


def _by_phase(of: "_Frame", species: Species, kelvin: Cells):
    """What of the content of a variable is water, and what is ice.

    WSM3 keeps both in one, of which all is ice where it freezes.
    """
    frozen = {"QCLOUD": "QICE", "QRAIN": "QSNOW"}.get(species.content)
    if int(getattr(of.file, "MP_PHYSICS", 0)) != _WSM3 or frozen is None:
        return [(species, 1.0)]
    ice = next(other for other in SPECIES if other.content == frozen)
    cold = kelvin < _FREEZING_K
    return [(species, np.where(cold, 0.0, 1.0)), (ice, np.where(cold, 1.0, 0.0))]


def _winds(of: "_Frame", grid: ColumnGrid) -> tuple[Cells, Cells, Cells]:
    """In the middle of the cells: the mean of both sides, as WRF's grid C has them."""
    u, v, w = of["U"], of["V"], of["W"]
    along_x = (u[..., 1:] + u[..., :-1]) / 2
    along_y = (v[:, 1:] + v[:, :-1]) / 2
    east, north = grid.projection.to_east_and_north(
        *grid.places(*grid.mesh()), along_x, along_y
    )
    return east, north, (w[1:] + w[:-1]) / 2


@dataclass(frozen=True, eq=False)
class _Frame:
    """Variables of one time, as float64."""

    frame: WrfFrame
    file: netCDF4.Dataset

    @property
    def path(self) -> Path:
        return self.frame.path

    def has(self, *names: str) -> bool:
        return all(name in self.file.variables for name in names)

    def require(self, *names: str) -> None:
        missing = [name for name in names if not self.has(name)]
        if missing:
            raise DataError(
                f"{self.path} has no {', '.join(missing)}: clouds need all of "
                f"{', '.join(names)}, write them out too."
            )

    def __getitem__(self, name: str) -> np.ndarray:
        stored = self.file.variables[name]
        timed = bool(stored.dimensions) and stored.dimensions[0] == "Time"
        raw = np.asarray(stored[self.frame.number] if timed else stored[:])
        values = raw.astype(np.float64)
        # The library's own mark needs no attribute.
        values[np.abs(values) > _BEYOND] = np.nan
        for mark in ("_FillValue", "missing_value"):
            if mark in stored.ncattrs():
                values[raw == stored.getncattr(mark)] = np.nan
        values *= float(getattr(stored, "scale_factor", 1.0))
        values += float(getattr(stored, "add_offset", 0.0))
        if not np.isfinite(values).all():
            wrong = int((~np.isfinite(values)).sum())
            raise DataError(
                f"{self.path} has no number at {wrong} points of {name}: the run or "
                "the file broke there, choose another time or get the file again."
            )
        return values
