"""Particles of cloud as files: CF netCDF for work, PLY for viewers."""

import os
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import xarray as xr
from jaxtyping import Float

import cloudjax
from cloudjax.geometry.geodesy import east_north_up, ecef
from cloudjax.particles.cloud_particles import CloudParticles
from cloudjax_data import DataError
from cloudjax_data.whole_files import staged

from .netcdf import write_netcdf


# name: attributes, all per particle
_VARIABLES: Mapping[str, Mapping[str, str]] = {
    "radius": {"long_name": "radius of the sphere of a particle", "units": "m"},
    "extinction_area": {
        "long_name": "optical depth at 0.64 um times area",
        "units": "m2",
    },
    "opacity": {"long_name": "share of the light that its disc stops", "units": "1"},
    "eastward_wind": {"standard_name": "eastward_wind", "units": "m s-1"},
    "northward_wind": {"standard_name": "northward_wind", "units": "m s-1"},
    "upward_air_velocity": {"standard_name": "upward_air_velocity", "units": "m s-1"},
    "birth": {"long_name": "beginning of life, after the time", "units": "s"},
    "death": {"long_name": "end of life, after the time", "units": "s"},
    "ice_share": {"long_name": "share of the extinction that ice has", "units": "1"},
}


def particle_dataset(
    particles: CloudParticles,
    time: datetime | None = None,
    attributes: Mapping[str, object] | None = None,
) -> xr.Dataset:
    """Make a CF-1.8 Dataset of points.

    **Arguments:**

    - `time`: of the particles, in UTC, where it is known.
    - `attributes`: more of the file's, such as its source.
    """
    p = particles
    values = {
        "radius": p.radius_m,
        "extinction_area": p.extinction_area_m2,
        "opacity": p.opacity,
        **dict(zip(list(_VARIABLES)[3:6], p.velocity_m_s.T, strict=True)),
        "birth": p.birth_s,
        "death": p.death_s,
        "ice_share": p.ice_share,
    }
    coordinates = {
        "latitude": (p.latitude_deg, "latitude", "degrees_north"),
        "longitude": (p.longitude_deg, "longitude", "degrees_east"),
        "altitude": (p.altitude_m, "altitude", "m"),
    }
    data = xr.Dataset(
        {
            name: ("particle", array.astype(np.float32), dict(_VARIABLES[name]))
            for name, array in values.items()
        },
        coords={
            name: ("particle", array, {"standard_name": standard, "units": units})
            for name, (array, standard, units) in coordinates.items()
        },
        attrs={
            "Conventions": "CF-1.8",
            "featureType": "point",
            "title": "Particles of cloud",
            "source": f"cloudjax {cloudjax.__version__}",
            **(attributes or {}),
        },
    )
    if time is not None:
        stamp = np.datetime64(time.astimezone(UTC).replace(tzinfo=None), "ns")
        data = data.assign_coords(time=((), stamp, {"standard_name": "time"}))
        data["time"].encoding = {"units": "seconds since 1970-01-01", "dtype": "f8"}
    return data


def local_position_m(
    particles: CloudParticles, origin_deg: tuple[float, float] | None = None
) -> tuple[Float[np.ndarray, "particles 3"], tuple[float, float]]:
    """Find positions to the east, to the north and upwards of a place on the ground.

    **Arguments:** `origin_deg`: latitude and longitude; by default the mean place.

    **Returns:** positions [m] and the place.
    """
    position = particles.position_m()
    if origin_deg is None:
        x, y, z = position.mean(axis=0)
        level = np.hypot(x, y)
        origin_deg = (
            float(np.degrees(np.arctan2(z, level))),
            float(np.degrees(np.arctan2(y, x))),
        )
    latitude, longitude = (np.array(degrees) for degrees in origin_deg)
    ground = ecef(latitude, longitude, np.array(0.0))
    return (position - ground) @ east_north_up(*origin_deg).T, origin_deg


def _write_ply(path: Path, particles: CloudParticles) -> None:
    """Write PLY 1.0, binary and little-endian, in metres about the middle."""
    position, (latitude, longitude) = local_position_m(particles)
    columns = {
        **dict(zip("xyz", position.T, strict=True)),
        "radius": particles.radius_m,
        "opacity": particles.opacity,
        "extinction_area": particles.extinction_area_m2,
        **dict(zip(("vx", "vy", "vz"), particles.velocity_m_s.T, strict=True)),
    }
    table = np.empty(len(particles), [(name, "<f4") for name in columns])
    for name, values in columns.items():
        table[name] = values
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment cloudjax {cloudjax.__version__}: metres east, north and up of "
        f"latitude {latitude:.6f} longitude {longitude:.6f}",
        f"element vertex {len(particles)}",
        *(f"property float {name}" for name in columns),
        "end_header",
    ]
    path.write_bytes("\n".join([*header, ""]).encode("ascii") + table.tobytes())


def write_particles(
    path: str | os.PathLike[str],
    particles: CloudParticles,
    time: datetime | None = None,
    attributes: Mapping[str, object] | None = None,
) -> None:
    """Write particles as CF netCDF (`.nc`) or as PLY (`.ply`).

    **Arguments:** `time`, `attributes`: as of `particle_dataset`; not of PLY.

    **Raises:** `DataError` for another ending, and if the disk does not take them.
    """
    path = require_particle_file(path)
    with staged(path.parent, last=path.name) as aside:
        if path.suffix == ".ply":
            _write_ply(aside / path.name, particles)
        else:
            data = particle_dataset(particles, time, attributes)
            write_netcdf(aside / path.name, data)


def require_particle_file(path: str | os.PathLike[str]) -> Path:
    """Return the path, or raise `DataError` for an ending that is none of particles."""
    path = Path(path)
    if path.suffix not in (".nc", ".ply"):
        raise DataError(
            f"{path} ends neither in .nc nor in .ply: these are the files that "
            "particles are written to."
        )
    return path
