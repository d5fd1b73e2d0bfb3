"""The benchmark runs from end to end, on little work and without optional peers."""

import importlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cloudjax_fit.trade.quality import CHOICES, REFERENCE, STANDARD
from tests.fit_trades import made_up_fit


ROOT = Path(__file__).parents[2]


def bench(
    *options: object, script: str = "bench.py"
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, f"benchmarks/{script}", *map(str, options)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_a_quick_benchmark_writes_its_tables(tmp_path):
    done = bench("--quick", "-o", tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "bench.json").read_text())
    (row,) = found["parts"]["table3"]["rows"]
    peer, ours = row["entries"]
    assert peer["peer"]
    assert min(peer["seconds"], ours["seconds"], *ours["view_seconds"].values()) > 0
    # One hard ray sees a point of a pixel of hundreds of kilometres.
    assert 0 < ours["rmse"] < peer["rmse"] < 0.5
    assert "brute" not in (tmp_path / "bench.md").read_text()
    assert (tmp_path / "bench.png").is_file()
    assert found["machine"]["cores"] in (tmp_path / "bench.md").read_text()


def test_the_parts_that_render_nothing_write_their_tables(tmp_path):
    """What stands in for the whole: two maps of one wind, and the start of commands."""
    done = bench("--quick", "--only", "displacement,startup", "-o", tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "bench.json").read_text())
    assert list(found["parts"]) == ["displacement", "startup"]
    assert 0 < found["parts"]["displacement"]["apart_m"] < 50
    text = (tmp_path / "bench.md").read_text()
    assert found["machine"]["cores"] in text
    assert "Displacement map of 5.0°" in text


def test_promises_are_kept_within_a_factor_of_two_up_or_down(monkeypatch):
    monkeypatch.syspath_prepend(ROOT)
    promise = importlib.import_module("benchmarks.promise")

    def kept(error: float, seconds: float):
        return promise.Kept(
            scene="a sensor over gfs.grib2",
            bands=(2, 13),
            pixels=100,
            options="--steps 12 --nodes 3",
            error=error,
            error_expected=0.02,
            seconds=seconds,
            seconds_expected=3.0,
            compiled_s=9.0,
        )

    rows = [kept(0.039, 1.6), kept(0.011, 5.9), kept(0.009, 6.5), kept(0.041, 1.4)]
    assert [row.keeps_error for row in rows] == [True, True, False, False]
    assert [row.keeps_seconds for row in rows] == [True, True, False, False]
    text = promise.table(rows)
    assert "in 50%, times in 50%" in text
    assert text.count("| a sensor | 2, 13 |") == 4


def test_the_scenes_of_promises_are_not_those_of_fronts(monkeypatch):
    monkeypatch.syspath_prepend(ROOT)
    scenes = importlib.import_module("benchmarks.parts.promise_scenes")
    fronts = importlib.import_module("benchmarks.fronts")
    cases = list(scenes.cases())

    def rays(sensor):
        return sensor.view.rays(np.array([0, 17]))

    def alike(a, b) -> bool:
        pairs = (a.origin_m, b.origin_m), (a.direction, b.direction)
        return all(np.allclose(one, other, rtol=1e-9) for one, other in pairs)

    measured = [rays(sensor) for sensor in fronts.SENSORS]
    assert not any(alike(rays(c.sensor), known) for c in cases for known in measured)
    assert len({case.bands for case in cases}) >= 8
    assert len(cases) >= 40


def test_fits_are_tabled_beside_the_front_that_ships(monkeypatch):
    """Double precision is in the table, and no choice of the front."""
    monkeypatch.syspath_prepend(ROOT)
    trade = importlib.import_module("benchmarks.fit_trade")

    def fitted(subject, quality):
        return made_up_fit(quality, 2.0)

    monkeypatch.setattr(trade, "fitted", fitted)
    monkeypatch.setattr(trade, "_doubled", lambda _: made_up_fit(STANDARD, 3.0))
    subject = trade.package_subject("paper")
    rows = list(trade.measured(subject, "paper"))
    front = trade.front_of(subject, rows)
    assert str(front.kind) == "fits in paper light by texture"
    assert front.scene.reference.quality == REFERENCE
    assert [trial.quality for trial in front.scene.trials] == list(CHOICES)
    lines = trade.table(rows).splitlines()
    assert len(lines) == 2 + 1 + len(CHOICES) + 1
    assert lines[2].startswith("| 16384 | 48 | 32 bit |")
    assert lines[-1].startswith("| 8192 | 24 | 64 bit |")
    assert lines[-1].endswith("| 2.00 | 2.00 | 2.0 |")


def test_targets_are_ratios_of_what_was_measured(monkeypatch):
    """One that is met at larger errors says so."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    targets = importlib.import_module("parts.targets")

    def entry(name, seconds, rmse, **more):
        known = {"everything_seconds": 2 * seconds, "w1": 0.01, "peak_mb": 500}
        return {"name": name, "seconds": seconds, "rmse": rmse, **known, **more}

    entries = [
        entry("Dr.Jit", 1.2, 0.06, peer=True, ratio_march=12.0),
        entry("cloudjax, 2 steps, 1 node", 0.1, 0.07, peer=False),
        entry("cloudjax, 6 steps, 3 nodes", 0.2, 0.03, peer=False),
    ]
    row = {"title": targets.DISC, "gtx1650_ms": 195, "entries": entries}
    text = targets.tables({"table3": {"rows": [row]}})
    assert "| whole picture against Dr.Jit, 6 steps, 3 nodes | 3x | 3x | 6x |" in text
    assert "2 steps, 1 node (errors larger) | 6x | 4x | 8x |" in text
    assert "at equal or smaller error | 12x | 10x | 20x |" in text
    assert "against the paper's GTX 1650 | 0.97x | 0.5x | 1x |" in text
    assert "| 0.5 GB | 1 GB | 0.5 GB |" in text
    assert not targets.tables({"displacement": {}})


def test_a_part_that_does_not_exist_is_refused():
    done = bench("--only", "table4")
    assert done.returncode == 2
    assert "table4" in done.stderr


@pytest.mark.slow
def test_pictures_and_derivatives_of_a_device_are_timed(tmp_path, monkeypatch):
    monkeypatch.setenv("CLOUDJAX_DATA", str(tmp_path))
    done = bench(
        "--devices", "cpu", "--pixels", 60, "-o", tmp_path, script="devices.py"
    )
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "devices.md").read_text()
    assert "disc 60², 2 steps, 1 nodes, prepared" in text
    assert "gradient, 3600 rays" in text


def test_a_device_that_is_not_there_is_refused(tmp_path):
    done = bench("--devices", "tpu", "-o", tmp_path, script="devices.py")
    assert done.returncode == 2
    assert "--devices" in done.stderr
    assert not any(tmp_path.iterdir())
