"""What is known of ABI's bands where a file does not say it."""

import functools as ft
import importlib.resources
import tomllib
from dataclasses import dataclass

import numpy as np


FIRST_EMISSIVE = 7

# How L1b files pack their radiances, on all satellites: scale and offset of the counts,
# in the units of the radiances.
_PACKING = {
    1: (0.8121064, -25.936647),
    2: (0.15859237, -20.289911),
    3: (0.37691253, -12.037643),
    4: (0.07073108, -4.5223684),
    5: (0.09580004, -3.0596137),
    6: (0.030088475, -0.9609507),
    7: (0.001564351, -0.0376),
    8: (0.007104763, -0.5586),
    9: (0.022539102, -0.8236),
    10: (0.02004128, -0.9561),
    11: (0.03335779, -1.3022),
    12: (0.05443998, -1.5394),
    13: (0.04572892, -1.6443),
    14: (0.049492206, -1.7187),
    15: (0.05277411, -1.7558),
    16: (0.17605852, -5.2392),
}


@dataclass(frozen=True)
class Nominal:
    """A band as it is nominally.

    **Fields:** `wavelength_um`; `esun` [W m-2 um-1] or `planck` (fk1, fk2, bc1, bc2),
    the other None; `of`: the satellite whose these are.
    """

    wavelength_um: float
    esun: float | None
    planck: tuple[float, float, float, float] | None
    of: str


def nominal(platform: str, number: int) -> Nominal:
    """Return a band of a satellite such as "G17"; of one not known, that of GOES-16."""
    renderers, own = _tables()
    table = renderers[str(number)]
    found = own.get(platform, {}).get(str(number))
    of = "GOES-16" if found is None else f"GOES-{platform[1:]}"
    found = table if found is None else found
    wavelength = float(table["wavelength_um"])
    if number < FIRST_EMISSIVE:
        esun = found.get("esun", found.get("solar_irradiance_w_m2_um"))
        return Nominal(wavelength, float(esun), None, of)
    fk1, fk2, bc1, bc2 = (float(found[key]) for key in ("fk1", "fk2", "bc1", "bc2"))
    return Nominal(wavelength, None, (fk1, fk2, bc1, bc2), of)


def smallest_positive_radiance(number: int) -> float:
    """Return what the first count above zero stands for in L1b files of a band.

    Not that of a file's own packing, which tools change and radiances do not know.
    """
    scale, offset = _PACKING[number]
    return float((np.floor(-offset / scale) + 1) * scale + offset)


def lost_offset(number: int, scale: float, offset: float) -> bool:
    """Tell whether a packing has the scale of L1b files of a band and another offset.

    Tools that pack anew choose both.
    """
    usual_scale, usual_offset = _PACKING[number]
    same = abs(scale / usual_scale - 1) < 1e-5
    return same and abs(offset - usual_offset) > 0.1 * scale


@ft.cache
def _tables() -> tuple[dict, dict]:
    files = (
        ("cloudjax.light", "nominal_bands.toml"),
        ("cloudjax_data", "nominal_abi.toml"),
    )
    of_renderer, own = (
        tomllib.loads(
            importlib.resources.files(package).joinpath(name).read_text("utf-8")
        )
        for package, name in files
    )
    return of_renderer, own
