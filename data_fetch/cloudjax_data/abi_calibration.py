"""The coefficients of a band are those of its file, checked, or nominal ones."""

from datetime import datetime
from pathlib import Path

import netCDF4

from .calibration import Calibration, EmissiveCalibration, ReflectiveCalibration
from .errors import DataError
from .nominal import FIRST_EMISSIVE, Nominal, nominal, smallest_positive_radiance
from .packed import scalar
from .sun import earth_sun_distance_au


_PLANCK = ("fk1", "fk2", "bc1", "bc2")
_DISTANCE = "earth_sun_distance_anomaly_in_AU"
# Coefficients differ by less between the satellites of the series; a band differs by
# more from the next one.
_LIKE_NOMINAL = 0.05
# Of the corrections for the width of the band, which are small: bc1 and 1 - bc2.
_LIKE_NOMINAL_WIDTH = 0.3


def read_calibration(
    file: netCDF4.Dataset,
    path: Path,
    suffix: str,
    number: int,
    platform: str,
    time: datetime,
) -> tuple[Calibration, tuple[str, ...]]:
    """Read the coefficients that apply to a band; those of the other kind hold -999.

    **Arguments:** `suffix`: of the band's variables, such as "_C13" in files of many
    bands, which have none of the coefficients.

    **Returns:** the calibration, and sentences on what had to be assumed.

    **Raises:** `DataError` if some are missing, contradict each other, or are those of
    another band.
    """
    usual = nominal(platform, number)
    emissive = number >= FIRST_EMISSIVE
    names = [f"planck_{key}" for key in _PLANCK] if emissive else ["kappa0", "esun"]
    found = {name: scalar(file, f"{name}{suffix}") for name in names}
    missing = [name for name, value in found.items() if value is None]
    notes: tuple[str, ...] = ()
    if len(missing) == len(names):
        calibration = _nominal_calibration(usual, number, time)
        notes = (
            f"{path.name} has no calibration coefficients: the nominal ones of "
            f"{usual.of} serve.",
        )
    elif missing:
        raise DataError(
            f"{path} has no value for {f'{missing[0]}{suffix}'!r}: it is not a "
            "complete ABI L1b or CMI file, download it again."
        )
    elif emissive:
        fk1, fk2, bc1, bc2 = (found[f"planck_{key}"] or 0.0 for key in _PLANCK)
        smallest = smallest_positive_radiance(number)
        calibration = EmissiveCalibration(fk1, fk2, bc1, bc2, smallest)
    else:
        distance = scalar(file, _DISTANCE)
        if distance is None:
            distance = earth_sun_distance_au(time)
            notes = (f"{path.name} does not say how far the sun is: its date does.",)
        kappa0, esun = found["kappa0"] or 0.0, found["esun"] or 0.0
        calibration = ReflectiveCalibration(kappa0, esun, distance)
    wrong = _contradiction(calibration, usual)
    if wrong is not None:
        raise DataError(f"{path} contradicts itself ({wrong}): download it again.")
    return calibration, notes


def _nominal_calibration(usual: Nominal, number: int, time: datetime) -> Calibration:
    if usual.planck is not None:
        return EmissiveCalibration(*usual.planck, smallest_positive_radiance(number))
    assert usual.esun is not None
    return ReflectiveCalibration.of_sun(usual.esun, earth_sun_distance_au(time))


def _contradiction(calibration: Calibration, usual: Nominal) -> str | None:
    """What is wrong, in words: coefficients against each other and against the band."""
    if isinstance(calibration, ReflectiveCalibration):
        assert usual.esun is not None
        pairs = {"esun": (calibration.solar_irradiance_w_m2_um, usual.esun)}
        apart = {"earth-sun distance": (calibration.earth_sun_distance_au, 1.0, 0.02)}
    else:
        assert usual.planck is not None
        fk1, fk2, bc1, bc2 = usual.planck
        pairs = {"fk1": (calibration.fk1, fk1), "fk2": (calibration.fk2, fk2)}
        apart = {
            "bc1": (calibration.bc1, bc1, _LIKE_NOMINAL_WIDTH * bc1),
            "bc2": (calibration.bc2, bc2, _LIKE_NOMINAL_WIDTH * (1 - bc2)),
        }
    for name, (value, expected) in pairs.items():
        if abs(value / expected - 1) > _LIKE_NOMINAL:
            return f"{name} is {value:g}, and {expected:g} nominally in its band"
    for name, (value, expected, most) in apart.items():
        if abs(value - expected) > most:
            return f"{name} is {value:g}, and {expected:g} nominally in its band"
    return calibration.inconsistency()
