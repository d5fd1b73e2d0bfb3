"""`cloudjax tradeoff` and `cloudjax info --cost` on a scene of a few pixels."""

import json

import pytest

from cloudjax_data.output_lock import alone
from cloudjax_scenes.quality import Quality
from cloudjax_scenes.trade import fronts, sweep
from tests.commands import run, sentence_of
from tests.scenes import NIGHT, write_scene


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """By night, measured about few steps; fronts are kept in a folder of the test."""
    monkeypatch.setattr(fronts.platformdirs, "user_data_path", lambda _: tmp_path)
    monkeypatch.setattr(sweep, "STANDARD", Quality(6, 1))
    monkeypatch.setattr(sweep, "REFERENCE", Quality(12, 3))
    monkeypatch.setattr(sweep, "_STEPS", (3, 6))
    monkeypatch.setattr(sweep, "_NODES", (1, 2))
    return write_scene(tmp_path / "scene", bands=(13,), start=NIGHT)


def test_a_trade_is_measured_written_and_kept(scene, tmp_path):
    result = run("tradeoff", scene, "--budget", "10min", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    written = json.loads((tmp_path / "out" / "tradeoff.json").read_text())
    (measured,) = written["scenes"]
    qualities = [Quality(**trial["quality"]) for trial in measured["trials"]]
    assert qualities[0] == Quality(6, 1)
    assert {Quality(3, 1), Quality(6, 2), Quality(6, 1, scattering=False)} <= {
        *qualities
    }
    assert measured["reference"]["quality"]["steps"] == 12
    errors = [trial["errors"]["13"]["rmse"] for trial in measured["trials"]]
    assert min(errors) > 0
    page = (tmp_path / "out" / "tradeoff.html").read_text()
    assert f"cloudjax render {scene}" in page
    assert "Kept as" in result.output
    # What is kept chooses for the scene, and the program says how it came out.
    image = tmp_path / "image.nc"
    again = run("render", scene, "--max-error", "90%", "-o", image)
    assert again.exit_code == 0, again.output
    kept = result.output.partition("Kept as ")[2].strip()
    assert f"(front: {kept})" in again.output
    assert "were expected" in again.output
    assert image.exists()


def test_a_short_trade_is_written_and_not_kept(scene, tmp_path):
    result = run("tradeoff", scene, "--budget", "0.001s", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "Not kept" in result.output
    assert (tmp_path / "out" / "tradeoff.html").exists()


def test_what_was_measured_before_an_interruption_is_written(
    scene, tmp_path, monkeypatch
):
    from cloudjax_cli import trade_files

    real, asked = trade_files.rendered, []

    def rendered(subject, quality):
        asked.append(quality)
        if len(asked) == 3:
            raise KeyboardInterrupt
        return real(subject, quality)

    monkeypatch.setattr(trade_files, "rendered", rendered)
    result = run("tradeoff", scene, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "Interrupted" in result.output
    written = json.loads((tmp_path / "out" / "tradeoff.json").read_text())
    assert [t["quality"]["steps"] for t in written["scenes"][0]["trials"]] == [6]


def test_nothing_measured_is_a_sentence(scene, tmp_path, monkeypatch):
    from cloudjax_cli import trade_files

    def rendered(subject, quality):
        raise KeyboardInterrupt

    monkeypatch.setattr(trade_files, "rendered", rendered)
    result = run("tradeoff", scene, "-o", tmp_path / "out")
    assert "Nothing of" in sentence_of(result)
    assert not (tmp_path / "out" / "tradeoff.json").exists()


def test_what_another_process_measures_into_a_folder_stays_alone(scene, tmp_path):
    with alone(tmp_path / "out", "tradeoff"):
        said = sentence_of(run("tradeoff", scene, "-o", tmp_path / "out"))
    assert "out is being written by process" in said


@pytest.mark.parametrize("budget", ["0", "-3s", "soon", "inf", "nan"])
def test_a_budget_is_a_time(scene, tmp_path, budget):
    result = run("tradeoff", scene, "--budget", budget, "-o", tmp_path / "out")
    assert "time" in sentence_of(result)


def test_costs_are_a_table(scene):
    result = run("info", scene, "--cost", "--budget", "0.1s")
    assert result.exit_code == 0, result.output
    lines = result.output.partition("each part of it:")[2].splitlines()
    rows = {line[:26].strip(): line[26:].split(maxsplit=1) for line in lines if line}
    assert rows["part"][0] == "used"
    assert rows["sunlight in band 7"][0] == "no"
    assert rows["shadows"][0] == "no"
    assert rows["gases"][0] == "yes"
    assert float(rows["all of it"][1].split()[0]) > 0
