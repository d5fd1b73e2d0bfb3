"""The scene of `cloudjax demo`: figures derived from a real one.

GOES-17 ABI, mesoscale sector 1, 2019-10-27 20:00 UTC, off southern California; made
from NOAA's open data by tools/make_embedded_scene.py.
"""

import importlib.resources

from cloudjax_fit.target_file import read_target
from cloudjax_fit.targets import Target


FILE = "goes17_m1_20191027T2000.nc"


def embedded_target() -> Target:
    """Return the target of the demonstration."""
    resource = importlib.resources.files(__name__) / FILE
    with importlib.resources.as_file(resource) as path:
        return read_target(path)
