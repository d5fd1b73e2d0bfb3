"""Write the table of `cloudjax.light.optics`: make_optics.py FOLDER [OUT]

FOLDER holds `abi_srf` (spectral responses of the ABI) and `optics` (refractive index of
water of Segelstein 1981; the coefficients of Fu 1996 and Fu et al. 1998 for ice, in the
layout of libRadtran's data files).

Water: Mie theory by miepython, gamma distributions of effective variance 0.1. Ice: the
published fits, which are smooth in size, by linear interpolation in wavelength. Means
over a band are weighted by its response and by the light: Planck's function at 5772 K
for sunlight (bands 1 to 7), at 270 K (water) or 230 K (ice) for emission (7 to 16).
Values are at the Chebyshev points of log r, between which `optics` interpolates.
"""

import os
import sys
from pathlib import Path

import numpy as np


os.environ["MIEPYTHON_USE_JIT"] = "1"
import miepython


SUN_K, DROPLET_K, CRYSTAL_K = 5772.0, 270.0, 230.0
EFFECTIVE_VARIANCE = 0.1
WATER_RADII_UM, WATER_POINTS = (2.0, 65.0), 28
# Generalised effective sizes of 18.6 to 130.2 µm, the range of Fu (1996).
ICE_RADII_UM, ICE_POINTS = (9.32, 65.1), 10
ICE_SIZE_PER_RADIUS = 8 / (3 * np.sqrt(3))
PARTICLE_RADII_UM = np.geomspace(0.1, 300.0, 3000)
ROWS = [(band, True) for band in range(1, 8)] + [(b, False) for b in range(7, 17)]


def rows(path: Path) -> np.ndarray:
    """The numbers of a file, without comments."""
    lines = [line.split() for line in path.read_text().splitlines()]
    return np.array(
        [[float(x) for x in line] for line in lines if line and _number(line[0])]
    )


def _number(word: str) -> bool:
    return word[0] in "-.0123456789"


def planck(wavelength_um: np.ndarray, kelvin: float) -> np.ndarray:
    return 1 / (wavelength_um**5 * np.expm1(14387.769 / (wavelength_um * kelvin)))


def band_weights(folder: Path, band: int, kelvin: float, points: int = 24):
    """Wavelengths across a band and their shares of its signal."""
    response = rows(folder / f"abi_srf/abi_pfm_ch{band:02d}.txt")
    response = response[np.argsort(response[:, 0])]
    edges = np.linspace(response[0, 0], response[-1, 0], points + 1)
    fine = np.linspace(edges[0], edges[-1], 50 * points)
    weight = np.interp(fine, *response.T) * planck(fine / 1e3, kelvin)
    share, _ = np.histogram(fine, edges, weights=weight)
    centre, _ = np.histogram(fine, edges, weights=weight * fine)
    some = share > 1e-4 * share.sum()
    return centre[some] / share[some] / 1e3, share[some] / share[some].sum()


def points(limits: tuple[float, float], count: int) -> np.ndarray:
    """Chebyshev points of the first kind in log r, ascending."""
    x = -np.cos(np.pi * (np.arange(count) + 0.5) / count)
    low, high = np.log(limits)
    return np.exp(low + (high - low) * (x + 1) / 2)


def water(folder: Path, wavelength_um: float, radii_um: np.ndarray):
    """Extinction and absorption in m²/g, and asymmetry, by radius."""
    index = rows(folder / "optics/segelstein81_index.txt")
    real = np.interp(wavelength_um, index[:, 0], index[:, 1])
    imaginary = np.exp(np.interp(wavelength_um, index[:, 0], np.log(index[:, 2])))
    size = 2 * np.pi * PARTICLE_RADII_UM / wavelength_um
    m = np.full(size.shape, real - 1j * imaginary)
    extinction, scattering, _, asymmetry = miepython.efficiencies_mx(m, size)
    # n(r) of Hansen & Travis (1974, eq. 2.56), per step of log r
    r, mean = PARTICLE_RADII_UM, radii_um[:, None]
    b = EFFECTIVE_VARIANCE
    log_number = (1 - 3 * b) / b * np.log(r / mean) - r / (mean * b)
    number = np.exp(log_number - log_number.max(axis=1, keepdims=True)) * r
    gram_per_m2 = 4 / 3 * (number @ r**3)  # over the same area; 1 g/cm³ and µm

    def per_gram(efficiency):
        return number @ (r**2 * efficiency) / gram_per_m2

    scattered = per_gram(scattering)
    turned = per_gram(scattering * asymmetry) / scattered
    absorbed = per_gram(np.maximum(extinction - scattering, 0))
    return scattered + absorbed, absorbed, turned


def ice(folder: Path, wavelength_um: float, radii_um: np.ndarray):
    """The same for ice, of the published polynomials in the generalised size."""
    folder = folder / "optics/ice_fu_1996_1998"
    size = radii_um * ICE_SIZE_PER_RADIUS
    if wavelength_um < 3:

        def at(name):
            table = rows(folder / f"fu96.{name}")
            return _interpolate(table[:, :2].mean(axis=1), table[:, 2:], wavelength_um)

        extinction = _polynomial(at("ext"), 1 / size)
        return (
            extinction,
            extinction * _polynomial(at("ssa"), size),
            _polynomial(at("asy"), size),
        )

    def at(name):
        table = rows(folder / f"fu98.{name}")
        return _interpolate(table[:, 0], table[:, 1:], wavelength_um)

    extinction = _polynomial(at("ext"), 1 / size)
    return extinction, _polynomial(at("abs"), size) / size, _polynomial(at("asy"), size)


def _interpolate(nodes, table, at):
    return np.array([np.interp(at, nodes, column) for column in table.T])


def _polynomial(coefficients, x):
    return np.polynomial.polynomial.polyval(x, coefficients)


def mean_optics(single, folder: Path, radii_um: np.ndarray, kelvin: float):
    """Extinction in m²/g, co-albedo and asymmetry, [rows radii] each."""
    means = []
    for band, sunlit in ROWS:
        at = band_weights(folder, band, SUN_K if sunlit else kelvin)
        total = np.zeros((3, len(radii_um)))
        for wavelength_um, share in zip(*at, strict=True):
            extinction, absorbed, asymmetry = single(folder, wavelength_um, radii_um)
            turned = (extinction - absorbed) * asymmetry
            total += share * np.array([extinction, absorbed, turned])
        extinction, absorbed, turned = total
        means.append(
            [extinction, absorbed / extinction, turned / (extinction - absorbed)]
        )
    return np.array(means).transpose(1, 0, 2)


HEADER = """\
# Cloud particles in the ABI bands: table of light/optics.py, by tools/make_optics.py.
#
# Rows: sunlight in bands 1 to 7, then emission in bands 7 to 16. Columns: effective
# radii. extinction in m2 per gram of condensate; co_albedo is 1 - single-scattering
# albedo. Water: Mie, index of Segelstein (1981), gamma distributions of effective
# variance 0.1. Ice: Fu (1996) below 3 um, Fu et al. (1998) above; the effective
# radius is 3 sqrt(3)/8 of the generalised effective size.
"""


def main() -> None:
    folder = Path(sys.argv[1])
    default = Path(__file__).parents[1] / "src/cloudjax/light/cloud_optics.toml"
    out = Path(sys.argv[2]) if len(sys.argv) > 2 else default
    text = HEADER
    for name, single, limits, count, kelvin in (
        ("water", water, WATER_RADII_UM, WATER_POINTS, DROPLET_K),
        ("ice", ice, ICE_RADII_UM, ICE_POINTS, CRYSTAL_K),
    ):
        radii = points(limits, count)
        print(f"{name}: {count} radii", flush=True)
        table = mean_optics(single, folder, radii, kelvin)
        text += f"\n[{name}]\nlimits_um = {list(limits)}\n"
        text += f"radius_um = [{_row(radii)}]\n"
        for key, values in zip(
            ("extinction_m2_per_g", "co_albedo", "asymmetry"), table, strict=True
        ):
            body = "".join(f"  [{_row(row)}],\n" for row in values)
            text += f"{key} = [\n{body}]\n"
    out.write_text(text)
    print(f"{out}: {out.stat().st_size} bytes")


def _row(values) -> str:
    return ", ".join(f"{x:.6g}" for x in values)


if __name__ == "__main__":
    main()
