"""How the command line ends: in words that any terminal can show, and in one code."""

import io
import os
import subprocess
import sys
from pathlib import Path

import click
import numpy as np
import pytest

from cloudjax_cli import main
from cloudjax_cli.options import Time
from cloudjax_cli.streams import forgive_encodings
from tests.commands import run, sentence_of
from tests.generated import write_abi_l1b
from tests.scenes import write_scene


ENCODINGS = ("gbk", "cp932", "big5", "koi8-r", "euc_jp", "ascii", "cp1252")


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_letters_that_are_not_there_are_spelt(monkeypatch, encoding):
    """All that the program prints, and names of files in any bytes."""
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, "stdout", stream)
    forgive_encodings()
    letters = "0.47 µm − × ÷ ± ° ² ³ … “x” ━ 雲 " + os.fsdecode(b"\xff")
    print(letters, file=stream)
    stream.flush()
    shown = stream.buffer.getvalue().decode(encoding)  # type: ignore[attr-defined]
    assert shown.startswith(("0.47 um", "0.47 µm", "0.47 μm"))
    assert shown.rstrip().endswith("\\xff")
    assert "\\xb5" not in shown


def test_a_run_in_another_encoding(tmp_path):
    """In a process of its own, where the streams are real."""
    write_scene(tmp_path / "scene", (13,))
    code = "from cloudjax_cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, "info", str(tmp_path / "scene")],
        env=os.environ | {"PYTHONIOENCODING": "gbk"},
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "10.33 um thermal" in done.stdout.decode("gbk")


@pytest.fixture
def faulty(monkeypatch):
    """A command with a fault."""

    @click.command()
    def broken():
        raise KeyError("no such\nkey")

    monkeypatch.setitem(main.commands, "broken", broken)


def test_a_fault_asks_for_a_report(faulty, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    result = run("broken")
    assert result.exit_code == 3
    (line,) = result.stderr.splitlines()
    (kept,) = tmp_path.glob("cloudjax-fault-*.txt")
    assert line.startswith("cloudjax: This is a fault of the program")
    assert "KeyError" in line
    assert f"please report it with {kept} and" in line
    assert "raise KeyError" in kept.read_text()
    assert "raise KeyError" not in result.output


def test_a_fault_is_shown_where_asked(faulty, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    result = run("--debug", "broken")
    assert result.exit_code == 3
    assert "raise KeyError" in result.stderr
    assert result.stderr.splitlines()[-1].startswith("cloudjax: This is a fault")
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_no_fault(monkeypatch):
    @click.command()
    def full():
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(main.commands, "full", full)
    said = sentence_of(run("full"))
    assert "No space left on device" in said


def test_a_closed_pipe_is_no_fault(tmp_path):
    write_scene(tmp_path / "scene", (13,))
    code = "from cloudjax_cli import main; main()"
    command = [sys.executable, "-c", code, "info", str(tmp_path / "scene")]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        running.stdout.close()
        said = running.stderr.read()
    assert running.returncode == 141, said
    assert said == b""


@pytest.mark.parametrize("command", ["fit", "report", "render"])
def test_outputs_are_named_in_text(tmp_path, command):
    scene = write_scene(tmp_path / "scene", (13,))
    odd = os.fsdecode(b"out\xff.nc")
    given = [scene, scene] if command == "report" else [scene]
    said = sentence_of(run(command, *given, "-o", tmp_path / odd))
    assert "out\\xff.nc has bytes in its name that are no UTF-8" in said


def test_scenes_may_be_named_in_any_bytes(tmp_path):
    scene = write_scene(tmp_path / "scene", (13,))
    scene = scene.rename(tmp_path / os.fsdecode(b"sc\xe8ne"))
    result = run("info", scene)
    assert result.exit_code == 0, result.output
    assert "no run" not in result.output


@pytest.mark.parametrize("zone", ["", "Z", "+00:00", "-05:00"])
def test_times_on_the_command_line_are_utc(monkeypatch, zone):
    monkeypatch.setenv("TZ", "America/Denver")
    found = Time().convert(f"2019-10-27T20:00{zone}", None, None)
    hours = 25 if zone == "-05:00" else 20
    assert found.timestamp() == 1572134400 + 3600 * (hours - 0)
    with pytest.raises(click.BadParameter):
        Time().convert("0001-01-01T00:00+23:00", None, None)


def test_a_broken_band_does_not_hide_the_others(tmp_path):
    scene = write_scene(tmp_path / "scene", (13,))
    path = write_abi_l1b(scene, band=16, radiance=np.full((48, 48), 60.0))
    path.write_bytes(path.read_bytes()[:3000])
    result = run("info", scene)
    assert result.exit_code == 0, result.output
    (line,) = [x for x in result.output.splitlines() if x.startswith("band 16")]
    assert "cannot be used" in line
    assert Path(path).name in line
    assert "no run" not in result.output
