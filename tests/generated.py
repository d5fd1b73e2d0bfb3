"""Writers of small ABI and GRIB files in the dialect of the real ones.

Packed counts, unsigned in signed integers, quality flags in bytes, coefficients of -999
where they do not apply: what readers stumble over is here. The numbers are those of
the flight files of GOES-16 and -17.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from cloudjax import FixedGrid
from cloudjax_data import EmissiveCalibration, ReflectiveCalibration, cf_attributes
from tests.generated_grib import write_grib as write_grib
from tests.generated_grib import write_lambert_grib as write_lambert_grib


SCAN_START = datetime(2019, 10, 27, 20, 0, 27, 500000, tzinfo=UTC)
EARTH_SUN_DISTANCE_AU = 0.9938448
ABSENT = np.float32(-999.0)


@dataclass(frozen=True)
class BandDialect:
    """How the files pack a band; `coefficients` are esun, or fk1, fk2, bc1, bc2."""

    wavelength_um: float
    step_rad: float
    bits: int
    scale: float
    offset: float
    coefficients: tuple[float, ...]

    @property
    def fill(self) -> int:
        """The highest count stands for no value."""
        return 2**self.bits - 1


DIALECT = {
    1: BandDialect(0.47, 2.8e-5, 10, 0.8121064, -25.936647, (2017.1648,)),
    2: BandDialect(0.64, 1.4e-5, 12, 0.15859237, -20.289911, (1631.3351,)),
    3: BandDialect(0.87, 2.8e-5, 10, 0.37691253, -12.037643, (957.0699,)),
    4: BandDialect(1.38, 5.6e-5, 11, 0.07073108, -4.5223684, (360.90176,)),
    5: BandDialect(1.61, 2.8e-5, 10, 0.09580004, -3.0596137, (242.54037,)),
    6: BandDialect(2.25, 5.6e-5, 10, 0.030088475, -0.9609507, (76.8999,)),
    7: BandDialect(
        3.89, 5.6e-5, 14, 0.001564351, -0.0376, (202263.0, 3698.19, 0.43361, 0.99939)
    ),
    8: BandDialect(
        6.17, 5.6e-5, 12, 0.007104763, -0.5586, (50687.1, 2331.58, 1.55228, 0.99667)
    ),
    9: BandDialect(
        6.93, 5.6e-5, 11, 0.022539102, -0.8236, (35828.3, 2076.95, 0.34427, 0.99918)
    ),
    10: BandDialect(
        7.34, 5.6e-5, 12, 0.02004128, -0.9561, (30174.0, 1961.38, 0.05651, 0.99986)
    ),
    11: BandDialect(
        8.44, 5.6e-5, 12, 0.03335779, -1.3022, (19779.9, 1703.83, 0.18733, 0.99948)
    ),
    12: BandDialect(
        9.61, 5.6e-5, 11, 0.05443998, -1.5394, (13432.1, 1497.61, 0.09102, 0.99971)
    ),
    13: BandDialect(
        10.33, 5.6e-5, 12, 0.04572892, -1.6443, (10803.3, 1392.74, 0.0755, 0.99975)
    ),
    14: BandDialect(
        11.19, 5.6e-5, 12, 0.049492206, -1.7187, (8510.22, 1286.27, 0.22516, 0.9992)
    ),
    15: BandDialect(
        12.27, 5.6e-5, 12, 0.05277411, -1.7558, (6454.62, 1173.03, 0.21702, 0.99916)
    ),
    16: BandDialect(
        13.27, 5.6e-5, 10, 0.17605852, -5.2392, (5101.27, 1084.53, 0.06266, 0.99974)
    ),
}


def window(
    shape: tuple[int, int],
    step_rad: float = 5.6e-5,
    *,
    west_edge_rad: float = 0.02464,
    north_edge_rad: float = 0.11536,
    subsatellite_longitude_deg: float = -137.0,
) -> FixedGrid:
    """A part of the fixed grid, by its outer edges so that resolutions nest.

    The corner is that of mesoscale sector 1 off California, seen from GOES-17. Edges
    must be multiples of 2 microradians for the centres to survive the files' rounding.
    """
    rows, columns = shape
    return FixedGrid(
        x_rad=west_edge_rad + step_rad * (np.arange(columns) + 0.5),
        y_rad=north_edge_rad - step_rad * (np.arange(rows) + 0.5),
        subsatellite_longitude_deg=subsatellite_longitude_deg,
    )


def write_abi_l1b(
    folder: Path,
    *,
    band: int,
    radiance: np.ndarray,
    grid: FixedGrid | None = None,
    dqf: np.ndarray | None = None,
    start: datetime = SCAN_START,
    seconds: float = 5.7,
    platform: str = "G17",
    orbital_slot: str = "GOES-West",
    sector: str = "M1",
    earth_sun_distance_au: float = EARTH_SUN_DISTANCE_AU,
    coefficients: Mapping[str, float] | None = None,
    name: str | None = None,
) -> Path:
    """Write an L1b file and return its path.

    **Arguments:**

    - `radiance`: `[y, x]` in the units of the band; NaN becomes the fill value.
    - `grid`: by default the window of the band's own resolution; pass
        `window(shape)` to put any band on 2 km.
    - `dqf`: quality flags, by default 0, 3 (no value) where NaN and 2 (out of range)
        where the counts cannot hold the radiance.
    - `coefficients`: replacements, by the variable names of the file.
    - `name`: instead of the name NOAA would give the file.
    """
    if grid is None:
        grid = window(radiance.shape, DIALECT[band].step_rad)
    given = _file_name("L1b-Rad", sector, f"C{band:02d}", platform, start, seconds)
    path = folder / (name or given)
    with netCDF4.Dataset(path, "w", format="NETCDF4") as file:
        _write_header(file, given, start, seconds, platform, orbital_slot, sector)
        _write_grid(file, grid)
        flags = _write_radiance(file, band, radiance)
        _write_flags(file, "DQF", flags if dqf is None else dqf)
        _write_band(file, "", band, earth_sun_distance_au, coefficients or {})
    return path


def write_abi_cmi(
    folder: Path,
    *,
    radiance: Mapping[int, np.ndarray],
    multi_band: bool = False,
    start: datetime = SCAN_START,
    seconds: float = 5.7,
    platform: str = "G17",
    sector: str = "M1",
) -> Path:
    """Write a CMI file of one band, or an MCMI file of several, on 2 km."""
    first = next(iter(radiance))
    product, channel = ("MCMIP", "") if multi_band else ("CMIP", f"C{first:02d}")
    name = _file_name(f"L2-{product}", sector, channel, platform, start, seconds)
    with netCDF4.Dataset(folder / name, "w", format="NETCDF4") as file:
        _write_header(file, name, start, seconds, platform, "GOES-West", sector)
        _write_grid(file, window(radiance[first].shape))
        for band, values in radiance.items():
            suffix = f"_C{band:02d}" if multi_band else ""
            calibration = default_calibration(band)
            if isinstance(calibration, EmissiveCalibration):
                values, units = calibration.brightness_temperature_k(values), "K"
                packing = 0.06145332, 89.62, 65535
            else:
                values, units = calibration.reflectance(values), "1"
                packing = 0.00031746, 0.0, 65535
            flags = _write_packed(
                file, f"CMI{suffix}", values, packing, {"units": units}
            )
            _write_flags(file, f"DQF{suffix}", flags)
            _write_band(file, suffix, band, EARTH_SUN_DISTANCE_AU, {})
            kind = "brightness_temperature" if band >= 7 else "reflectance_factor"
            for end, found in (("min", np.nanmin), ("max", np.nanmax)):
                extreme = np.float32(found(values))
                held = f"{end}_{kind}{suffix}"
                _write_scalar(file, held, extreme, {"units": units}, fill=ABSENT)
    return folder / name


def default_calibration(
    band: int, earth_sun_distance_au: float = EARTH_SUN_DISTANCE_AU
) -> ReflectiveCalibration | EmissiveCalibration:
    """The coefficients that `write_abi_l1b` puts in its files, in float64."""
    coefficients = DIALECT[band].coefficients
    if band >= 7:
        return EmissiveCalibration(*coefficients)
    esun, d = coefficients[0], earth_sun_distance_au
    return ReflectiveCalibration(float(np.pi * d**2 / esun), esun, d)


def _file_name(
    product: str,
    sector: str,
    channel: str,
    platform: str,
    start: datetime,
    seconds: float,
) -> str:
    times = [start + timedelta(seconds=s) for s in (0.0, seconds, seconds + 4.0)]
    stamps = (f"{t:%Y%j%H%M%S}{t.microsecond // 100000}" for t in times)
    s, e, c = stamps
    return f"OR_ABI-{product}{sector}-M6{channel}_{platform}_s{s}_e{e}_c{c}.nc"


def _write_header(
    file: netCDF4.Dataset,
    name: str,
    start: datetime,
    seconds: float,
    platform: str,
    orbital_slot: str,
    sector: str,
) -> None:
    scenes = {"F": "Full Disk", "C": "CONUS"}
    end = start + timedelta(seconds=seconds)
    file.setncatts(
        {
            "Conventions": "CF-1.7",
            "orbital_slot": orbital_slot,
            "platform_ID": platform,
            "instrument_type": "GOES R Series Advanced Baseline Imager",
            "scene_id": scenes.get(sector, "Mesoscale"),
            "instrument_ID": "FM2",
            "dataset_name": name,
            "timeline_id": "ABI Mode 6",
            "time_coverage_start": _tenths(start),
            "time_coverage_end": _tenths(end),
        }
    )
    epoch = datetime(2000, 1, 1, 12, tzinfo=UTC)
    middle = (start - epoch).total_seconds() + seconds / 2
    attributes = {"units": "seconds since 2000-01-01 12:00:00", "axis": "T"}
    _write_scalar(file, "t", np.float64(middle), attributes)


def _tenths(time: datetime) -> str:
    return f"{time:%Y-%m-%dT%H:%M:%S}.{time.microsecond // 100000}Z"


def _write_grid(file: netCDF4.Dataset, grid: FixedGrid) -> None:
    for name, angles in (("y", grid.y_rad), ("x", grid.x_rad)):
        file.createDimension(name, angles.size)
        axis = file.createVariable(name, "i2", (name,))
        axis.set_auto_maskandscale(False)
        step = (angles[-1] - angles[0]) / max(angles.size - 1, 1)
        axis.scale_factor = np.float32(step)
        axis.add_offset = np.float32(angles[0])
        axis.units = "rad"
        axis.standard_name = f"projection_{name}_coordinate"
        axis[:] = np.arange(angles.size)
    if "number_of_image_bounds" not in file.dimensions:
        file.createDimension("number_of_image_bounds", 2)
    for name, angles in (("y", grid.y_rad), ("x", grid.x_rad)):
        half = (angles[-1] - angles[0]) / max(angles.size - 1, 1) / 2
        ends = np.array([angles[0] - half, angles[-1] + half], np.float32)
        dimensions = ("number_of_image_bounds",)
        file.createVariable(f"{name}_image_bounds", "f4", dimensions)[:] = ends
    place = np.float32(grid.subsatellite_longitude_deg)
    _write_scalar(file, "nominal_satellite_subpoint_lon", place, {}, fill=ABSENT)
    attributes = cf_attributes(grid)
    attributes["long_name"] = "GOES-R ABI fixed grid projection"
    _write_scalar(file, "goes_imager_projection", np.int32(-2147483647), attributes)


def _write_radiance(
    file: netCDF4.Dataset, band: int, radiance: np.ndarray
) -> np.ndarray:
    dialect = DIALECT[band]
    per_wavelength = "wavelength", "W m-2 sr-1 um-1"
    per_wavenumber = "wavenumber", "mW m-2 sr-1 (cm-1)-1"
    per, units = per_wavenumber if band >= 7 else per_wavelength
    attributes = {
        "long_name": "ABI L1b Radiances",
        "standard_name": f"toa_outgoing_radiance_per_unit_{per}",
        "sensor_band_bit_depth": np.int8(dialect.bits),
        "units": units,
    }
    packing = dialect.scale, dialect.offset, dialect.fill
    return _write_packed(file, "Rad", radiance, packing, attributes)


def _write_packed(
    file: netCDF4.Dataset,
    name: str,
    values: np.ndarray,
    packing: tuple[float, float, int],
    attributes: Mapping[str, Any],
) -> np.ndarray:
    """Write the counts, and return the quality flags that go with them."""
    scale, offset, fill = np.float32(packing[0]), np.float32(packing[1]), packing[2]
    counts = np.round((values.astype(np.float64) - offset) / scale)
    absent, outside = np.isnan(values), (counts < 0) | (counts > fill - 1)
    stored = np.where(absent, fill, np.clip(np.nan_to_num(counts), 0, fill - 1))
    signed_fill = np.array(fill, np.uint16).view(np.int16)[()]
    packed = file.createVariable(
        name, "i2", ("y", "x"), fill_value=signed_fill, zlib=True, complevel=1
    )
    packed.set_auto_maskandscale(False)
    packed.setncatts(
        {
            "_Unsigned": "true",
            "valid_range": np.array([0, fill - 1], np.uint16).view(np.int16),
            "scale_factor": scale,
            "add_offset": offset,
            "grid_mapping": "goes_imager_projection",
            "ancillary_variables": name.replace("Rad", "DQF").replace("CMI", "DQF"),
            **attributes,
        }
    )
    packed[:] = stored.astype(np.uint16).view(np.int16)
    return np.where(absent, 3, np.where(outside, 2, 0))


def _write_flags(file: netCDF4.Dataset, name: str, flags: np.ndarray) -> None:
    byte = file.createVariable(
        name, "i1", ("y", "x"), fill_value=np.int8(-1), zlib=True, complevel=1
    )
    byte.set_auto_maskandscale(False)
    byte.setncatts(
        {
            "_Unsigned": "true",
            "standard_name": "status_flag",
            "flag_values": np.arange(5, dtype=np.int8),
            "flag_meanings": "good_pixel_qf conditionally_usable_pixel_qf "
            "out_of_range_pixel_qf no_value_pixel_qf "
            "focal_plane_temperature_threshold_exceeded_qf",
        }
    )
    byte[:] = flags.astype(np.uint8).view(np.int8)


def _write_band(
    file: netCDF4.Dataset,
    suffix: str,
    band: int,
    distance: float,
    replacements: Mapping[str, float],
) -> None:
    if "band" not in file.dimensions:
        file.createDimension("band", 1)
    file.createVariable(f"band_id{suffix}", "i1", ("band",))[:] = band
    wavelength = file.createVariable(f"band_wavelength{suffix}", "f4", ("band",))
    wavelength[:] = DIALECT[band].wavelength_um
    if suffix:
        # Files of many bands have no coefficients.
        return
    calibration = default_calibration(band, distance)
    names = ["esun", "kappa0", "planck_fk1", "planck_fk2", "planck_bc1", "planck_bc2"]
    values: dict[str, float] = dict.fromkeys(names, float(ABSENT))
    if isinstance(calibration, ReflectiveCalibration):
        values["esun"] = calibration.solar_irradiance_w_m2_um
        values["kappa0"] = calibration.reflectance_per_radiance
    else:
        for key in ("fk1", "fk2", "bc1", "bc2"):
            values[f"planck_{key}"] = getattr(calibration, key)
    values.update(replacements)
    for key, value in values.items():
        _write_scalar(file, key, np.float32(value), {}, fill=ABSENT)
    anomaly = "earth_sun_distance_anomaly_in_AU"
    _write_scalar(file, anomaly, np.float32(distance), {"units": "ua"}, fill=ABSENT)


def _write_scalar(
    file: netCDF4.Dataset,
    name: str,
    value: np.generic,
    attributes: Mapping[str, Any],
    fill: Any = None,
) -> None:
    scalar = file.createVariable(name, value.dtype.str, (), fill_value=fill)
    scalar.set_auto_maskandscale(False)
    scalar.setncatts(dict(attributes))
    scalar[...] = value
