"""`cloudjax info` of a weather file."""

from pathlib import Path

from tests.commands import run
from tests.weather_scenes import write_analysis


def test_info_says_what_a_weather_file_tells_of_clouds(tmp_path: Path):
    result = run("info", write_analysis(tmp_path / "gfs.grib2"))
    assert result.exit_code == 0, result.output
    assert "2019-10-27 18:00 UTC" in result.output
    assert "evidence: high cloud  relative humidity (Slingo 1987)" in result.output
    assert "table1: clouds" in result.output


def test_a_decision_that_does_not_exist_ends_with_a_sentence(tmp_path: Path):
    file = write_analysis(tmp_path / "gfs.grib2")
    asked = "--weather", file, "--decision", "paper", "-o", tmp_path / "out.nc"
    result = run("render", "abi-meso-10km", "--centre", "20,-80", *asked)
    assert result.exit_code == 2
    assert "no decision 'paper': make it evidence or table1" in result.output
