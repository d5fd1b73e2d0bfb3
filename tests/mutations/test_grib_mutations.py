"""Every mutation of a GRIB file ends in the right weather or in one true sentence."""

import zlib
from pathlib import Path

import numpy as np
import pytest

from cloudjax_data import DataError, WeatherCube, read_weather

from .grib_bases import GENERATED, REAL, generated, real
from .grib_mutations import FAIR, FEWER, HOLES, REFUSED, REPACKED, Mutation, mutations


# One in so many is tried in the default tier.
_SAMPLE = 24


@pytest.mark.parametrize("base", GENERATED)
def test_a_sample_of_mutations(tmp_path, base):
    content = generated(base, tmp_path)
    all_of_them = mutations(base, content)
    offset = GENERATED.index(base) * 5
    _try(tmp_path, content, all_of_them[offset::_SAMPLE])


@pytest.mark.slow
@pytest.mark.parametrize("base", GENERATED)
def test_all_mutations(tmp_path, base):
    content = generated(base, tmp_path)
    all_of_them = mutations(base, content)
    assert len(all_of_them) > 75
    _try(tmp_path, content, all_of_them)


@pytest.mark.slow
@pytest.mark.shared_data
@pytest.mark.parametrize("base", REAL)
def test_all_mutations_of_real_files(tmp_path, shared_data, base):
    content = real(shared_data / REAL[base])
    _try(tmp_path, content, mutations(base, content))


def _try(folder: Path, content: bytes, chosen: list[Mutation]) -> None:
    path = folder / "whole.grib"
    path.write_bytes(content)
    expected = read_weather(path)
    wrong = []
    for mutation in chosen:
        said = _verdict(folder, content, mutation, expected)
        if said:
            wrong.append(f"{mutation.name} ({mutation.expect}): {said}")
    assert not wrong, f"{len(wrong)} of {len(chosen)}\n" + "\n".join(wrong)


def _verdict(
    folder: Path, content: bytes, mutation: Mutation, expected: WeatherCube
) -> str:
    """What is wrong, nothing if all is well."""
    from .grib_bases import messages

    rng = np.random.default_rng(zlib.crc32(mutation.name.encode()))
    path = folder / mutation.file_name
    path.write_bytes(mutation.change(messages(content), rng))
    try:
        found = read_weather(path)
    except DataError as error:
        said = str(error)
        if mutation.expect not in (REFUSED, FAIR):
            return f"refused: {said}"
        one = said.startswith(str(path)) and said.endswith(".") and "\n" not in said
        return "" if one else f"no sentence on the file: {said}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        path.unlink()
    if mutation.expect == REFUSED:
        return "read"
    return _difference(found, expected, mutation.expect)


def _difference(found: WeatherCube, expected: WeatherCube, how: str) -> str:
    levels = found.data["level"].to_numpy()
    kept = set(levels) <= set(expected.data["level"].to_numpy())
    fewer = levels.size < expected.data["level"].size
    if not kept or (fewer and how not in (FEWER, FAIR)) or (how == FEWER and not fewer):
        return f"levels {levels}"
    if fewer and not any(found.lost_levels_hpa.values()):
        return f"levels {levels} without a word"
    if found.valid_time != expected.valid_time:
        return f"time {found.valid_time}"
    for axis in ("latitude", "longitude"):
        one, other = found.data[axis].to_numpy(), expected.data[axis].to_numpy()
        if one.shape != other.shape or np.abs(one - other).max() > 0.02:
            return f"{axis} {one}"
    for name in ("u", "v", "w", "r", "t", "gh"):
        one = found.data[name].to_numpy()
        other = expected.data[name].sel(level=levels).to_numpy()
        holes = np.isnan(one) & ~np.isnan(other)
        if holes.any() and how != HOLES:
            return f"{name} has holes"
        share = 1e-4 if how in (REPACKED, HOLES) else 1e-6
        tolerance = share * np.nanmax(np.abs(other))
        if np.nanmax(np.abs(one - other)) > tolerance:
            return f"{name} differs by {np.nanmax(np.abs(one - other))}"
    return ""
