"""Print the table of `cloudjax.optics`: make_optics.py FOLDER

FOLDER holds the coefficients of Hu & Stamnes (1993) for water and of Fu (1996) and
Fu et al. (1998) for ice, in the layout of libRadtran's data files. Values are taken at
the centre of each ABI band, by linear interpolation in wavelength, for droplets of
effective radius 10 µm and crystals of generalised effective size 60 µm.
"""

import sys
from pathlib import Path

import numpy as np


WAVELENGTH_UM = {
    1: 0.47, 2: 0.64, 3: 0.865, 4: 1.378, 5: 1.61, 6: 2.25, 7: 3.9, 8: 6.185,
    9: 6.95, 10: 7.34, 11: 8.5, 12: 9.61, 13: 10.35, 14: 11.2, 15: 12.3, 16: 13.3,
}  # fmt: skip
RADIUS_UM = 10.0
SIZE_UM = 60.0


def rows(path: Path) -> np.ndarray:
    """The numbers of a file, without comments."""
    lines = path.read_text().splitlines()
    return np.array(
        [line.split() for line in lines if line and line[0] not in "#!"], dtype=object
    )


def water(folder: Path, kind: str, wavelength_um: float) -> float:
    """a r^b + c of the first range of radii, 2.5 to 12.5 µm."""
    numbers = rows(folder / f"wc.{kind}")
    heads = [i for i, row in enumerate(numbers) if len(row) == 2]
    table = np.array([list(map(float, r)) for r in numbers[heads[0] + 1 : heads[1]]])
    value = table[:, 1] * RADIUS_UM ** table[:, 2] + table[:, 3]
    order = np.argsort(table[:, 0])
    return float(np.interp(wavelength_um, table[order, 0], value[order]))


def ice_co_albedo(folder: Path, wavelength_um: float) -> float:
    table = np.array([list(map(float, r)) for r in rows(folder / "fu96.ssa")])
    value = sum(table[:, 2 + i] * SIZE_UM**i for i in range(4))
    return float(np.interp(wavelength_um, table[:, :2].mean(1), value))


def ice_absorption(folder: Path, wavelength_um: float) -> float:
    table = np.array([list(map(float, r)) for r in rows(folder / "fu98.abs")])
    value = sum(table[:, 1 + i] * SIZE_UM**i for i in range(4)) / SIZE_UM
    return float(np.interp(wavelength_um, table[:, 0], value))


def main() -> None:
    hu, fu = (
        Path(sys.argv[1]) / n for n in ("water_hu_stamnes_1993", "ice_fu_1996_1998")
    )
    window_water = water(hu, "ext", 10.35) * water(hu, "ssa", 10.35)
    window_ice = ice_absorption(fu, 10.35)
    visible_ice = np.array(rows(fu / "fu96.ext")[8], float)
    print("absorption at 10.35 µm over extinction at 0.64 µm:")
    print("  water", window_water / water(hu, "ext", 0.64))
    print("  ice", window_ice / (visible_ice[2] + visible_ice[3] / SIZE_UM))
    for band, λ in WAVELENGTH_UM.items():
        if band < 7:
            print(band, f"{water(hu, 'ssa', λ):.3g}, {ice_co_albedo(fu, λ):.3g}")
        else:
            absorbed = water(hu, "ext", λ) * water(hu, "ssa", λ) / window_water
            print(band, f"{absorbed:.3f}, {ice_absorption(fu, λ) / window_ice:.3f}")


if __name__ == "__main__":
    main()
