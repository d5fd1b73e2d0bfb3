"""Make the scene that `cloudjax demo` fits: python tools/make_embedded_scene.py FOLDER

FOLDER holds the GOES-17 ABI L1b files of 2019-10-27 20:00 UTC, mesoscale sector 1. What
is kept are figures derived from bands 1, 3 and 13: quantiles and histograms of the
cloud pixels, cloud fractions, means of the clear pixels, and the geometry.
"""

import sys
from dataclasses import replace
from pathlib import Path

from cloudjax_data import open_folder
from cloudjax_fit.observation import observe
from cloudjax_fit.target_file import write_target
from cloudjax_scenes.lights import PAPER


BANDS = (1, 3, 13)
FILE = "goes17_m1_20191027T2000.nc"
EMBEDDED = Path(__file__).parents[1] / "fit" / "cloudjax_fit" / "embedded"
LARGEST_BYTES = 600_000
# Means of clear pixels are kept, and not pixels.
COARSER = 10


def main(folder: str) -> None:
    path = EMBEDDED / FILE
    scene = open_folder(folder).read(BANDS)
    target = observe(scene, BANDS, classes=PAPER.imagery_classes())
    background = target.imagery.background.coarsened(COARSER)
    imagery = replace(target.imagery, background=background)
    write_target(path, replace(target, imagery=imagery))
    size = path.stat().st_size
    print(f"{path.name}: {size / 1000:.0f} kB")
    if size > LARGEST_BYTES:
        sys.exit(f"{path.name} is larger than {LARGEST_BYTES / 1000:.0f} kB")


if __name__ == "__main__":
    main(*sys.argv[1:])
