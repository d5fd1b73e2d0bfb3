"""Hundreds of spoilt inputs: each is read right, or refused in one true sentence.

A file is right where its radiances, flags, places and times are those of the whole one,
to the rounding of floats; what it has lost must be told. A few of the changes run
always, all of them with `-m slow`.
"""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.generated import DIALECT, write_abi_cmi, write_abi_l1b
from tests.mutations.abi_mutations import abi_mutations, pairs
from tests.mutations.abi_results import difference, read_result
from tests.mutations.netcdf_content import changed
from tests.mutations.verdict import Mutation, fault_of


SHAPE = (24, 30)
SEED = 20260501


def radiance(band: int) -> np.ndarray:
    dialect = DIALECT[band]
    span = dialect.scale * dialect.fill
    values = np.random.default_rng(band).uniform(0.1 * span, 0.5 * span, SHAPE)
    values[3, 4:9] = np.nan
    return values


def flags(band: int) -> np.ndarray:
    found = np.where(np.isnan(radiance(band)), 3, 0)
    found[10:12] = [[1], [4]]
    return found


def l1b(folder: Path, band: int = 13) -> Path:
    return write_abi_l1b(folder, band=band, radiance=radiance(band), dqf=flags(band))


def cmi(folder: Path, band: int = 13) -> Path:
    return write_abi_cmi(folder, radiance={band: radiance(band)})


def many(folder: Path) -> Path:
    return write_abi_cmi(folder, radiance={13: radiance(13)}, multi_band=True)


def real(folder: Path, data: Path, band: int) -> Path:
    """A part of a real file, small enough to be written hundreds of times."""
    (file,) = (data / "goes17_m1_20191201T1027_night").glob(f"*C{band:02d}_*.nc")
    copy = folder / file.name
    shutil.copy(file, copy)

    def cut(content):
        for held in content.variables.values():
            where = tuple(
                slice(200, 200 + 24) if d in "xy" else slice(None)
                for d in held.dimensions
            )
            held.stored = held.stored[where]
        content.dimensions |= {"x": 24, "y": 24}

    return changed(copy, cut)


def faults(make, mutations: list[Mutation], root: Path) -> list[str]:
    """All that goes wrong with changed copies of a file, in words."""
    origin = root / "origin"
    origin.mkdir()
    whole = make(origin)
    right = read_result(origin)
    found = []
    for i, mutation in enumerate(mutations):
        folder = root / str(i)
        folder.mkdir()
        mutation.apply(Path(shutil.copy(whole, folder / whole.name)))
        lost = any(word in str(mutation) for word in ("fill", "along"))
        fault = fault_of(
            lambda folder=folder: read_result(folder),
            lambda result, lost=lost: difference(result, right, lost),
        )
        if fault is not None:
            found.append(f"{mutation}: {fault}")
        shutil.rmtree(folder)
    return found


FAMILIES = {
    "l1b 13": (l1b, "Rad", "DQF"),
    "l1b 2": (lambda folder: l1b(folder, 2), "Rad", "DQF"),
    "cmi 13": (cmi, "CMI", "DQF"),
    "cmi 3": (lambda folder: cmi(folder, 3), "CMI", "DQF"),
    "mcmi 13": (many, "CMI_C13", "DQF_C13"),
}


@pytest.mark.parametrize("family", ["l1b 13", "mcmi 13"])
def test_a_few_spoilt_files_of_abi(tmp_path, family):
    make, image, quality = FAMILIES[family]
    every = abi_mutations(image, quality)
    assert len(every) > 250
    assert faults(make, every[::9], tmp_path) == []


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_spoilt_files_of_abi(tmp_path, family):
    make, image, quality = FAMILIES[family]
    assert faults(make, abi_mutations(image, quality), tmp_path) == []


@pytest.mark.slow
def test_files_that_are_spoilt_twice(tmp_path):
    drawn = pairs(abi_mutations(), 300, int(os.environ.get("CLOUDJAX_SEED", SEED)))
    assert faults(l1b, drawn, tmp_path) == []


@pytest.mark.slow
@pytest.mark.shared_data
@pytest.mark.parametrize("band", [7, 13])
def test_spoilt_real_files(tmp_path, shared_data, band):
    def make(folder):
        return real(folder, shared_data, band)

    assert faults(make, abi_mutations(), tmp_path) == []


def test_the_sweep_sees_what_is_wrong(tmp_path):
    """A change that no reader can know of: the sweep must tell it."""

    def warm(path):
        def add(content):
            content.variables["Rad"].stored += 50

        changed(path, add)

    (said,) = faults(l1b, [Mutation("warmer", warm)], tmp_path)
    assert "other radiances" in said
