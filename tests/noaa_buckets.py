"""NOAA's buckets in small: generated files in folders of the real layout."""

from collections.abc import Iterable
from datetime import datetime, timedelta
from pathlib import Path

import netCDF4
import numpy as np

from tests.generated import window, write_abi_l1b
from tests.generated_grib import write_grib


SHAPE = (40, 40)
LEVELS_HPA = {1000: 110.0, 850: 1450.0, 500: 5600.0, 200: 11800.0, 70: 18500.0}
# By the reader's short names, as the indices of NOAA abbreviate them.
ABBREVIATIONS = {
    "gh": "HGT",
    "t": "TMP",
    "r": "RH",
    "w": "VVEL",
    "u": "UGRD",
    "v": "VGRD",
    "clwmr": "CLMR",
    "q": "SPFH",
    "orog": "HGT",
    "lsm": "LAND",
    "2t": "TMP",
}
VALUES = {"t": 270.0, "r": 60.0, "w": 0.1, "u": 5.0, "v": 1.0, "clwmr": 0.0, "q": 0.01}
# In ABI's mode 6 a scan takes so long.
SECONDS = {"F": 569.0, "C": 236.0, "M1": 5.7, "M2": 5.7}


def add_scan(
    root: Path,
    start: datetime,
    *,
    satellite: str = "goes16",
    sector: str = "C",
    bands: Iterable[int] = (1, 3, 13),
    products: Iterable[str] = (),
) -> list[Path]:
    """Put one scan into the bucket of a satellite; the paths of its files."""
    platform, seconds = f"G{satellite[-2:]}", SECONDS[sector]
    files = []
    for band in bands:
        folder = goes_folder(root, satellite, f"L1b-Rad{sector[0]}", start)
        radiance = np.random.default_rng(band).uniform(20.0, 80.0, SHAPE)
        files.append(
            write_abi_l1b(
                folder,
                band=band,
                radiance=radiance,
                grid=window(SHAPE, subsatellite_longitude_deg=-75.0),
                # bands begin within tenths of a second of each other
                start=start + timedelta(milliseconds=100 * (band % 3)),
                seconds=seconds,
                platform=platform,
                orbital_slot="GOES-East",
                sector=sector,
            )
        )
    for product in products:
        folder = goes_folder(root, satellite, f"L2-{product}{sector[0]}", start)
        times = (start + timedelta(seconds=s) for s in (0.0, seconds, seconds + 90.0))
        s, e, c = (f"{t:%Y%j%H%M%S}{t.microsecond // 100000}" for t in times)
        name = f"OR_ABI-L2-{product}{sector}-M6_{platform}_s{s}_e{e}_c{c}.nc"
        files.append(_write_product(folder / name))
    return files


def goes_folder(root: Path, satellite: str, product: str, start: datetime) -> Path:
    """Where a bucket keeps the scans of an hour."""
    folder = root / f"noaa-{satellite}" / f"ABI-{product}" / f"{start:%Y/%j/%H}"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def add_gfs(
    root: Path, cycle: datetime, lead_hours: int = 0, *, grid: str = "1p00"
) -> Path:
    """Put the fields of one cycle and lead into the bucket of the GFS, with index."""
    folder = root / "noaa-gfs-bdp-pds" / f"gfs.{cycle:%Y%m%d/%H/atmos}"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"gfs.t{cycle:%H}z.pgrb2.{grid}.f{lead_hours:03d}"
    latitude, longitude = np.arange(90.0, -91.0, -30.0), np.arange(0.0, 360.0, 30.0)
    shape = latitude.size, longitude.size
    fields = {("t", 50): np.full(shape, 210.0)}
    for level, height in LEVELS_HPA.items():
        fields["gh", level] = np.full(shape, height)
        fields |= {
            (name, level): np.full(shape, value) for name, value in VALUES.items()
        }
    ground = {("orog", 0): 900.0, ("t", 0): 290.0, ("lsm", 0): 1.0, ("2t", 2): 288.0}
    for key, highest in ground.items():
        values = np.linspace(0.9 * highest, highest, latitude.size * longitude.size)
        fields[key] = values.reshape(shape)
    write_grib(
        path,
        fields,
        latitude_deg=latitude,
        longitude_deg=longitude,
        time=cycle,
        extra={"centre": "kwbc", "forecastTime": lead_hours},
    )
    write_index(path, list(fields), cycle, lead_hours)
    return path


def write_index(
    path: Path, fields: Iterable[tuple[str, int]], cycle: datetime, lead_hours: int
) -> Path:
    """The index of a file in which the fields stand in that order."""
    forecast = f"{lead_hours} hour fcst" if lead_hours else "anl"
    content, start, lines = path.read_bytes(), 0, []
    for number, (name, level) in enumerate(fields, 1):
        near_the_ground = {0: "surface", 2: "2 m above ground"}
        where = near_the_ground.get(level, f"{level} mb")
        lines.append(
            f"{number}:{start}:d={cycle:%Y%m%d%H}:{ABBREVIATIONS[name]}:{where}:"
            f"{forecast}:\n"
        )
        start += int.from_bytes(content[start + 8 : start + 16])
    assert start == len(content)
    index = path.with_name(f"{path.name}.idx")
    index.write_text("".join(lines))
    return index


def _write_product(path: Path) -> Path:
    with netCDF4.Dataset(path, "w") as file:
        file.dataset_name = path.name
        file.createDimension("y", 8)
        file.createVariable("DQF", "i1", ("y",))[:] = 0
    return path
