"""A sensor's bands from its TOML file: nominal ones, changed where it says so."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from cloudjax.light.bands import PLANCK, Band, nominal_bands
from cloudjax.toml_table import NUMBER, WHOLE, checked, is_whole
from cloudjax_data import DataError, EmissiveCalibration


# Of bands that only reflect, and of those that emit too: each in its file's units.
_PER_WAVELENGTH = "solar_irradiance_w_m2_um"
_PER_WAVENUMBER = "solar_irradiance_mw_m2_cm"


def bands_from(entries: Sequence[Any], where: str) -> dict[int, Band]:
    """Make bands from a list of numbers, or of tables with a number and own constants.

    **Raises:** `DataError` for a table that holds anything else, or a band given twice.
    """
    bands: dict[int, Band] = {}
    for entry in entries:
        band = _band(entry if isinstance(entry, Mapping) else {"number": entry}, where)
        if band.number in bands:
            raise DataError(f"{where} gives band {band.number} twice: keep one.")
        bands[band.number] = band
    if not bands:
        raise DataError(f"{where} gives no bands: list numbers from 1 to 16.")
    return dict(sorted(bands.items()))


def _band(entry: Mapping[str, Any], where: str) -> Band:
    known = nominal_bands()
    chosen = entry.get("number")
    if not is_whole(chosen) or chosen not in known:
        raise DataError(
            f"{where} gives a band the number {chosen!r}: make it one from 1 to 16."
        )
    nominal = known[chosen]
    solar = _PER_WAVELENGTH if nominal.reflective else _PER_WAVENUMBER
    keys = ([solar] if nominal.sunlit else []) + (
        [] if nominal.reflective else [*PLANCK]
    )
    given = checked(
        entry,
        {"number": WHOLE},
        {"wavelength_um": NUMBER, **dict.fromkeys(keys, NUMBER)},
        f"{where}, band {chosen},",
    )
    if 0 < len(given.keys() & set(PLANCK)) < len(PLANCK):
        raise DataError(
            f"{where} gives band {chosen} only some of {', '.join(PLANCK)}: give all "
            "or none."
        )
    own: dict[str, Any] = {}
    if PLANCK[0] in given:
        own["planck"] = tuple(given[key] for key in PLANCK)
    if solar in given:
        own["solar_irradiance"] = given[solar]
    if "wavelength_um" in given:
        own["wavelength_um"] = given["wavelength_um"]
    band = dataclasses.replace(nominal, **own)
    _require_sound(band, where)
    return band


def _require_sound(band: Band, where: str) -> None:
    positive = [band.wavelength_um]
    if band.solar_irradiance is not None:
        positive.append(band.solar_irradiance)
    if min(positive) <= 0:
        raise DataError(
            f"{where} gives band {band.number} a wavelength or irradiance that is not "
            "positive: correct it."
        )
    if band.planck is None:
        return
    fk1, fk2, _, bc2 = band.planck
    if min(fk1, fk2, bc2) <= 0:
        raise DataError(
            f"{where} gives band {band.number} an fk1, fk2 or bc2 that is not "
            "positive: correct it."
        )
    wrong = EmissiveCalibration(*band.planck).inconsistency()
    if wrong is not None:
        raise DataError(
            f"{where} gives band {band.number} coefficients that contradict each "
            f"other ({wrong}): copy them from a file of the sensor."
        )
