"""A sensor's bands: what radiance means in each, without a file of radiances."""

import importlib.resources
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cloudjax.light.bands import EMISSIVE_UNITS, REFLECTIVE_UNITS
from cloudjax_data import DataError, EmissiveCalibration

from .toml_table import NUMBER, WHOLE, checked, is_whole


# Of bands that only reflect, and of those that emit too: each in its file's units.
_SOLAR = ("solar_irradiance_w_m2_um", "solar_irradiance_mw_m2_cm")
_PLANCK = ("fk1", "fk2", "bc1", "bc2")


@dataclass(frozen=True)
class SensorBand:
    """One band.

    **Fields:**

    - `number`: of the ABI band, 1 to 16, whose optics of cloud and ground it has.
    - `wavelength_um`: central wavelength.
    - `constants`: `solar_irradiance_w_m2_um` at 1 astronomical unit, or `fk1`, `fk2`,
        `bc1`, `bc2`; band 7 has the latter and `solar_irradiance_mw_m2_cm`.
    """

    number: int
    wavelength_um: float
    constants: Mapping[str, float]

    @property
    def sunlit(self) -> bool:
        """Whether it sees the sun by day."""
        return self._solar is not None

    @property
    def reflective(self) -> bool:
        """Whether it is looked at in reflectance: whether it does not emit."""
        return "fk1" not in self.constants

    @property
    def _solar(self) -> float | None:
        return next((self.constants[k] for k in _SOLAR if k in self.constants), None)

    @property
    def name(self) -> str:
        return f"C{self.number:02d}"

    @property
    def units(self) -> str:
        """Of the radiance."""
        return REFLECTIVE_UNITS if self.reflective else EMISSIVE_UNITS

    def coefficients(self, earth_sun_distance_au: float = 1.0) -> dict[str, float]:
        """`kappa0` where it is sunlit, `fk1`, `fk2`, `bc1`, `bc2` where it emits."""
        planck = {k: self.constants[k] for k in _PLANCK if k in self.constants}
        if self._solar is None:
            return planck
        return planck | {"kappa0": np.pi * earth_sun_distance_au**2 / self._solar}


def nominal_bands() -> dict[int, SensorBand]:
    """The 16 bands of ABI on GOES-16, by number."""
    file = importlib.resources.files("cloudjax_scenes").joinpath("nominal_bands.toml")
    tables = tomllib.loads(file.read_text(encoding="utf-8"))
    return {
        int(key): SensorBand(int(key), table.pop("wavelength_um"), table)
        for key, table in tables.items()
    }


def bands_from(entries: Sequence[Any], where: str) -> dict[int, SensorBand]:
    """Bands from a list of numbers, or of tables with a number and what is not nominal.

    **Raises:** `DataError` for a table that holds anything else, or a band given twice.
    """
    bands: dict[int, SensorBand] = {}
    for entry in entries:
        band = _band(entry if isinstance(entry, Mapping) else {"number": entry}, where)
        if band.number in bands:
            raise DataError(f"{where} gives band {band.number} twice: keep one.")
        bands[band.number] = band
    if not bands:
        raise DataError(f"{where} gives no bands: list numbers from 1 to 16.")
    return dict(sorted(bands.items()))


def _band(entry: Mapping[str, Any], where: str) -> SensorBand:
    known = nominal_bands()
    chosen = entry.get("number")
    if not is_whole(chosen) or chosen not in known:
        raise DataError(
            f"{where} gives a band the number {chosen!r}: make it one from 1 to 16."
        )
    nominal = known[chosen]
    constants = dict.fromkeys(nominal.constants, NUMBER)
    given = checked(
        entry,
        {"number": WHOLE},
        {"wavelength_um": NUMBER, **constants},
        f"{where}, band {chosen},",
    )
    own = {key: given[key] for key in constants if key in given}
    if 0 < len(own.keys() & set(_PLANCK)) < len(_PLANCK):
        raise DataError(
            f"{where} gives band {chosen} only some of {', '.join(_PLANCK)}: give all "
            "or none."
        )
    wavelength = given.get("wavelength_um", nominal.wavelength_um)
    band = SensorBand(chosen, wavelength, {**nominal.constants, **own})
    _require_sound(band, where)
    return band


def _require_sound(band: SensorBand, where: str) -> None:
    irradiances = [band.constants[key] for key in _SOLAR if key in band.constants]
    if min([band.wavelength_um, *irradiances]) <= 0:
        raise DataError(
            f"{where} gives band {band.number} a wavelength or irradiance that is not "
            "positive: correct it."
        )
    if band.reflective:
        return
    if min(band.constants[key] for key in ("fk1", "fk2", "bc2")) <= 0:
        raise DataError(
            f"{where} gives band {band.number} an fk1, fk2 or bc2 that is not "
            "positive: correct it."
        )
    wrong = EmissiveCalibration(*(band.constants[k] for k in _PLANCK)).inconsistency()
    if wrong is not None:
        raise DataError(
            f"{where} gives band {band.number} coefficients that contradict each "
            f"other ({wrong}): copy them from a file of the sensor."
        )
