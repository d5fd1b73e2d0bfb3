"""Weather of two times, two simple classes, and one image of them."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from tests.commands import run
from tests.generated_grib import write_grib


NOON = datetime(2019, 10, 27, 18, tzinfo=UTC)
LEVELS = {1000: 110.0, 850: 1500.0, 700: 3000.0, 500: 5600.0, 300: 9200.0, 100: 16500.0}
SMALL = ("--steps", "6")
ASKED = ("--bands", "2,7,13", "--quantity", "all")
MESO = ("abi-meso-10km", "--centre", "20,-80")
CLASS = """
[{name}]
threshold = -0.3
mask_gain = 1.1
base_m = {base}
top_m = {top}
barrier_scale_m = 300
mask_displacement_hours = {hours}
extinction_per_m = {extinction}
particles = "{particles}"
effective_radius_um = {radius}

[{name}.conditions]
sampling_altitude_m = {sampled}
shell_bottom_m = {bottom}
shell_top_m = {shell_top}
vertical_wind_min_pa_s = -inf
vertical_wind_max_pa_s = inf
temperature_min_k = {coldest}
temperature_max_k = inf
critical_relative_humidity = 0.3
vertical_wind_width_pa_s = 0.2
temperature_width_k = 5.0

[[{name}.textures]]
noise = "gaussian"
longest_m = 225e3
shortest_m = 50e3
weight = 1.0
persistence = 0.5
displacement_hours = {hours}
"""
LOW = {
    "name": "low",
    "base": 700,
    "top": 2000,
    "hours": 0.0,
    "extinction": 0.05,
    "particles": "water",
    "radius": 10,
    "sampled": 2000,
    "bottom": 500,
    "shell_top": 3000,
    "coldest": 250.0,
}
HIGH = LOW | {
    "name": "high",
    "base": 7500,
    "top": 9500,
    "hours": 3.0,
    "extinction": 0.002,
    "particles": "ice",
    "radius": 30,
    "sampled": 8000,
    "bottom": 7000,
    "shell_top": 10000,
    "coldest": 0.0,
}


def write_analysis(file: Path, time: datetime = NOON, humid: float = 85.0) -> Path:
    """A coarse analysis, humid but around one meridian, with wind from the west."""
    latitude, longitude = np.arange(90.0, -91.0, -10.0), np.arange(0.0, 360.0, 10.0)
    φ, λ = np.radians(np.meshgrid(latitude, longitude, indexing="ij"))
    fields = {}
    for level, height in LEVELS.items():
        fields |= {
            ("gh", level): np.full(φ.shape, height),
            ("t", level): 300 - 6.5e-3 * min(height, 11e3) - 40 * np.sin(φ) ** 2,
            ("r", level): np.clip(humid - 60 * np.cos(λ - 4.0), 5, 95),
            ("w", level): np.full(φ.shape, -0.05),
            ("u", level): 20 * np.cos(φ),
            ("v", level): 5 * np.sin(2 * λ) * np.cos(φ),
        }
    return write_grib(
        file, fields, latitude_deg=latitude, longitude_deg=longitude, time=time
    )


def write_inputs(folder: Path) -> Path:
    """Weather of two times and two simple classes."""
    write_analysis(folder / "gfs.grib2")
    write_analysis(folder / "later.grib2", NOON + timedelta(hours=3), humid=70.0)
    text = CLASS.format(**LOW) + CLASS.format(**HIGH)
    (folder / "classes.toml").write_text(text)
    return folder


def inputs(folder: Path) -> tuple:
    """Options of a render; the decision of Table 1, by which the images are stored."""
    classes = folder / "classes.toml"
    weather = "--weather", folder / "gfs.grib2", "--decision", "table1"
    return *weather, "--classes", classes, *SMALL


def render_image(folder: Path, file: Path) -> Path:
    """The image of `MESO`, by the command line."""
    result = run("render", *MESO, *inputs(folder), *ASKED, "-o", file)
    assert result.exit_code == 0, result.output
    assert str(file) in result.stdout
    return file
