"""The scan angles of an ABI file, checked against the one projection that ABI has."""

import netCDF4
import numpy as np
from jaxtyping import Float

from cloudjax.geometry.fixed_grid import FixedGrid
from cloudjax.geometry.geodesy import GRS80, Ellipsoid

from .errors import DataError
from .grid_mapping import GRID_MAPPING
from .packed import (
    attribute,
    counts,
    number_attribute,
    scalar,
    scale_and_offset,
    variable,
)


# No scan angle of a full disc with the space around it is greater.
_LARGEST_ANGLE_RAD = 0.2
# How far a scan angle may be from where even steps put it: files round to microradians.
_UNEVEN_RAD = 2e-6
# Of the ellipsoid and of the height: all files of ABI have the same.
_SAME = 1e-6
# A satellite drifts about the longitude of its projection, and is moved at times.
_DRIFT_DEG = 5.0
SLOTS_DEG = {"GOES-East": -75.0, "GOES-West": -137.0}
_RADIANS = {"rad": 1.0, "radian": 1.0, "radians": 1.0, "microradian": 1e-6}
_METRES = ("m", "meter", "meters", "metre", "metres")


def read_fixed_grid(file: netCDF4.Dataset) -> FixedGrid:
    """Read the grid of a file of ABI, rows from the north and columns from the west or
    not, as they are stored.

    **Raises:** `DataError` if angles are missing, uneven, not those of a disc seen from
    a geostationary orbit, or in an unknown unit; if the projection is not that of ABI.
    """
    projection = variable(file, GRID_MAPPING)
    height = number_attribute(projection, "perspective_point_height")
    ellipsoid = Ellipsoid(
        number_attribute(projection, "semi_major_axis"),
        number_attribute(projection, "semi_minor_axis"),
    )
    sweep = str(attribute(projection, "sweep_angle_axis"))
    if sweep != "x":
        raise DataError(
            f"{file.filepath()} sweeps {sweep!r}, and ABI sweeps 'x': download it "
            "again."
        )
    grid = FixedGrid(
        x_rad=read_scan_angles(file, "x", height),
        y_rad=read_scan_angles(file, "y", height),
        subsatellite_longitude_deg=_longitude(file, projection),
        perspective_height_m=height,
        ellipsoid=ellipsoid,
    )
    usual = FixedGrid(grid.x_rad, grid.y_rad, 0.0)
    pairs = (
        ("height", height, usual.perspective_height_m),
        ("semi-major axis", ellipsoid.semi_major_m, GRS80.semi_major_m),
        ("semi-minor axis", ellipsoid.semi_minor_m, GRS80.semi_minor_m),
    )
    for name, value, expected in pairs:
        if abs(value / expected - 1) > _SAME:
            raise DataError(
                f"{file.filepath()} gives its projection a {name} of {value:g} m, and "
                f"ABI's is {expected:.10g} m: download it again."
            )
    return grid


def _longitude(file: netCDF4.Dataset, projection: netCDF4.Variable) -> float:
    given = number_attribute(projection, "longitude_of_projection_origin")
    if not -180 <= given <= 360:
        raise DataError(
            f"{file.filepath()} has its satellite over longitude {given:g}: download "
            "it again."
        )
    longitude = given if given <= 180 else given - 360
    slot = SLOTS_DEG.get(str(getattr(file, "orbital_slot", "")))
    for place in (scalar(file, "nominal_satellite_subpoint_lon"), slot):
        if place is None:
            continue
        if abs((longitude - place + 180) % 360 - 180) > _DRIFT_DEG:
            raise DataError(
                f"{file.filepath()} contradicts itself (its projection is of longitude "
                f"{longitude:g}, its satellite over {place:g}): download it again."
            )
    return longitude


def read_scan_angles(
    file: netCDF4.Dataset, name: str, height_m: float
) -> Float[np.ndarray, " angles"]:
    """Read the scan angles [rad] of the axis `x` or `y`.

    **Arguments:** `height_m`: of the projection, for angles that are stored in metres.

    **Raises:** `DataError` if they are missing, uneven or in an unknown unit.
    """
    packed = variable(file, name)
    if packed.ndim != 1 or packed.size == 0:
        raise DataError(
            f"{file.filepath()} has {name!r} on {packed.ndim} dimensions of "
            f"{packed.size} values, which is no row of scan angles: download it again."
        )
    stored, valid = counts(packed)
    scale, offset = scale_and_offset(packed)
    unit = _radians_per_unit(file, packed, height_m)
    angles = stored.astype(np.float64)
    if unit != 1.0 or (stored.dtype.kind == "f" and (scale, offset) == (1.0, 0.0)):
        # a copy rewritten by xarray holds the decoded angles, in float32
        angles = np.round(unit * (angles * scale + offset), 6)
    else:
        # Scale and offset are float32 roundings of multiples of a microradian: undo
        # that, or the far end of a full disk is off by a tenth of a pixel.
        angles = angles * round(scale, 6) + round(offset, 6)
    if valid.all() and _is_even(angles):
        _check_within_image(file, name, angles)
        return angles
    raise DataError(
        f"{file.filepath()} has scan angles {name!r} that are missing, uneven or none "
        "that a satellite has of the Earth: download it again."
    )


def _check_within_image(file: netCDF4.Dataset, name: str, angles: np.ndarray) -> None:
    """A part of an image is within what the file says are its bounds."""
    held = f"{name}_image_bounds"
    if held not in file.variables:
        return
    bounds, valid = counts(variable(file, held))
    slack = abs(angles[-1] - angles[0]) / max(angles.size - 1, 1) + _UNEVEN_RAD
    if bounds.size != 2 or not valid.all():
        return
    low, high = bounds.min() - slack, bounds.max() + slack
    if angles.min() < low or angles.max() > high:
        raise DataError(
            f"{file.filepath()} contradicts itself (its scan angles {name!r} reach "
            f"beyond {held!r}): download it again."
        )


def _radians_per_unit(
    file: netCDF4.Dataset, packed: netCDF4.Variable, height_m: float
) -> float:
    given = str(getattr(packed, "units", "rad")).strip().lower()
    if given in _METRES:
        return 1 / height_m
    if given in _RADIANS:
        return _RADIANS[given]
    raise DataError(
        f"{file.filepath()} has scan angles {packed.name!r} in {given!r}: give them in "
        "rad, or in m of the projection."
    )


def _is_even(angles: np.ndarray) -> bool:
    if np.abs(angles).max() > _LARGEST_ANGLE_RAD:
        return False
    if angles.size == 1:
        return True
    even = np.linspace(angles[0], angles[-1], angles.size)
    step = abs(even[1] - even[0])
    return bool(step > _UNEVEN_RAD and np.abs(angles - even).max() <= _UNEVEN_RAD)
