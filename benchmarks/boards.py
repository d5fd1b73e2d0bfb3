"""Memory and loading time of skies of 1 to 10 000 boards in a browser.

The thesis (X3D graphics clouds for geographic information systems, Table 1) had a node
for each board, in Internet Explorer 7 with Cortona. Here a cloud is cut into more and
more boards, for X3DOM and X_ITE.

    CLOUDJAX_NODE_MODULES=.../node_modules python benchmarks/boards.py FOLDER

needs Chromium, node and npm's x3dom, x_ite and puppeteer-core. Heap is JavaScript's.
"""

import os
import shutil
import sys
from datetime import UTC, datetime
from pathlib import Path

from tests.browsing import look, missing_browser, served, x_ite_page

from cloudjax_scenes.by_type.placing import particles_of
from cloudjax_scenes.by_type.sky_file import read_sky
from cloudjax_scenes.model_scene import ModelWorld
from cloudjax_scenes.particle_columns import ParticleColumns
from cloudjax_scenes.x3d.export import write_sky
from cloudjax_scenes.x3d.sights import box_about, sight_of_columns
from cloudjax_scenes.x3d.sky import ExportSettings, Sight


# Megabytes of Table 1, by boards.
THESIS = {1: 31, 10: 41, 100: 55, 1000: 150, 10_000: 900}
PLACE, SIZE_KM, PIXELS = (36.6, -121.9), 15.0, 256
SKY = """
[[clouds]]
type = "stratus"
quantity = 1
within_m = 1
width_m = 13000
kernels = 4000
"""


def the_sight(folder: Path) -> Sight:
    """One sheet of cloud, so that a single board may stand for it."""
    path = folder / "sky.toml"
    path.write_text(SKY)
    particles = particles_of(read_sky(path), PLACE)
    time = datetime(2026, 6, 21, 20, tzinfo=UTC)
    world = ModelWorld(ParticleColumns.of(particles, path, time))
    return sight_of_columns(world, box_about(PLACE, SIZE_KM), time, "those of the file")


def main(folder: Path) -> None:
    modules = os.environ.get("CLOUDJAX_NODE_MODULES")
    lacks = missing_browser(modules)
    if modules is None or lacks:
        sys.exit(f"boards.py needs a browser: {lacks}.")
    folder.mkdir(parents=True, exist_ok=True)
    sight = the_sight(folder)
    print("boards  drawn  thesis MB  X3DOM MB  s  X_ITE MB  s  scene.x3d MB")
    for boards, thesis in THESIS.items():
        sky = folder / str(boards)
        made = write_sky(
            sky,
            sight,
            ExportSettings(boards=boards, pixels=PIXELS),
            library=Path(modules) / "x3dom" / "x3dom.js",
        )
        drawn = made["sectors"]["up"]["boards"][0]
        x3dom = _look(modules, sky / "viewer.html", sky)
        with served(sky, Path(modules)) as address:
            x_ite = _look(modules, f"{address}/{x_ite_page(sky, 'scene.x3d')}", sky)
        size = (sky / "scene.x3d").stat().st_size / 1e6
        seen = "  ".join(
            f"{one['heap_mb']:.0f}  {one['seconds']:.1f}" for one in (x3dom, x_ite)
        )
        print(f"{boards}  {drawn}  {thesis}  {seen}  {size:.1f}", flush=True)
        shutil.rmtree(sky)


def _look(modules: str, page: str | Path, sky: Path) -> dict:
    return look(Path(modules), page, sky / "seen.png", 1, (200, 150), 1.0)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
