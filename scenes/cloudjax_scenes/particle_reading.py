"""Particles are read back from the netCDF files that `particle_files` writes."""

import os
from datetime import UTC, datetime, timedelta
from pathlib import Path

import netCDF4
import numpy as np
from jaxtyping import Float

from cloudjax.particles.cloud_particles import CloudParticles
from cloudjax_data import DataError
from cloudjax_data.packed import netcdf_file


_VELOCITY = ("eastward_wind", "northward_wind", "upward_air_velocity")


def read_particles(
    path: str | os.PathLike[str],
) -> tuple[CloudParticles, datetime | None]:
    """Read particles that live, and their time, None where the file has none.

    **Raises:** `DataError` for a file that is absent, is of another kind, or holds
    particles that are none: without a number, without a size, or outside the Earth.
    """
    path = Path(path)
    with netcdf_file(path) as file:
        found = CloudParticles(
            latitude_deg=_read(path, file, "latitude"),
            longitude_deg=_read(path, file, "longitude"),
            altitude_m=_read(path, file, "altitude"),
            radius_m=_read(path, file, "radius"),
            extinction_area_m2=_read(path, file, "extinction_area"),
            velocity_m_s=np.stack([_read(path, file, n) for n in _VELOCITY], axis=-1),
            birth_s=_read(path, file, "birth", endless=True),
            death_s=_read(path, file, "death", endless=True),
            ice_share=_read(path, file, "ice_share"),
        )
        time = _time(path, file)
    possible = (
        (np.abs(found.latitude_deg) <= 90)
        & (found.radius_m > 0)
        & (found.extinction_area_m2 >= 0)
        & (found.ice_share >= 0)
        & (found.ice_share <= 1)
    )
    if not possible.all():
        raise DataError(
            f"{path} has {int((~possible).sum())} particles beyond the poles, without "
            "a size, or with less than no cloud: write it with cloudjax particles."
        )
    living = found.alive(0.0)
    if not len(living):
        raise DataError(f"{path} has no particle that lives: choose another file.")
    return living, time


def _read(
    path: Path, file: netCDF4.Dataset, name: str, *, endless: bool = False
) -> Float[np.ndarray, " particles"]:
    if name not in file.variables or file.variables[name].dimensions != ("particle",):
        raise DataError(
            f"{path} has no {name} of particles: give a file that cloudjax particles "
            "has written."
        )
    values = np.asarray(file.variables[name][:], float)
    right = ~np.isnan(values) if endless else np.isfinite(values)
    if not right.all():
        raise DataError(
            f"{path} has no number at {int((~right).sum())} particles of {name}: write "
            "the file again."
        )
    return values


def _time(path: Path, file: netCDF4.Dataset) -> datetime | None:
    if "time" not in file.variables:
        return None
    stored = file.variables["time"]
    if str(getattr(stored, "units", "")) != "seconds since 1970-01-01":
        raise DataError(
            f"{path} has a time that does not count seconds since 1970-01-01: give a "
            "file that cloudjax particles has written."
        )
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=float(stored[...]))
