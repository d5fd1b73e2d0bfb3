"""What the figures depend on: the machine, the versions, and the data at hand."""

import importlib.metadata
import os
import platform
import time
from pathlib import Path

import numpy as np
from peers.problem import CLASS, generated_fraction


ROOT = Path(__file__).parents[2]
GFS = "gfs_2p5deg_20110115T12"
PACKAGES = ("cloudjax", "jax", "jaxlib", "numpy", "scipy", "numba", "drjit")


def machine() -> dict[str, str]:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None
    return {
        "date": time.strftime("%Y-%m-%d"),
        "processor": _processor(),
        "cores": str(cores or os.cpu_count()),
        "load before": f"{os.getloadavg()[0]:.1f}",
        "python": platform.python_version(),
        "packages": ", ".join(
            f"{name} {version}" for name in PACKAGES if (version := _version(name))
        ),
    }


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if not info.exists():
        return platform.processor() or platform.machine()
    names = [
        line.split(":", 1)[1].strip()
        for line in info.read_text().splitlines()
        if line.startswith("model name")
    ]
    return names[0] if names else platform.machine()


def data_folder() -> Path | None:
    """The folder of real GOES and GFS files, where there is one."""
    folder = Path(os.environ.get("CLOUDJAX_DATA", ROOT.parent / "shared" / "data"))
    return folder if folder.is_dir() else None


def low_cloud_fraction(generated: bool) -> tuple[np.ndarray, str]:
    """Of low cumulus by the paper's Table 1, from GFS, and a word on its source."""
    folder = data_folder()
    files = [] if generated or folder is None else [*(folder / GFS).glob("*.grib2")]
    if not files:
        return generated_fraction(), (
            "The weather mask is generated: set CLOUDJAX_DATA to a folder with "
            f"{GFS} for that of GFS."
        )
    from cloudjax_scenes.weather_scene import open_world

    world = open_world(files, decision="table1")
    start = world.series.times[0]
    fraction = np.nan_to_num(world.fractions[0][CLASS])
    return fraction, f"The weather mask is that of GFS, {start:%F %H} UTC."
