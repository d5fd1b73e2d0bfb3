"""X3D in a real browser: Chromium, X3DOM and X_ITE, where they are installed."""

import base64
import functools as ft
import http.server
import io
import json
import os
import re
import shutil
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread, imsave

from cloudjax import Camera, look, products, sun_over
from cloudjax.geometry.geodesy import ecef
from cloudjax_data import open_wrf, read_wrf
from cloudjax_scenes.model_scene import ModelWorld
from cloudjax_scenes.x3d.box import Box
from cloudjax_scenes.x3d.seen_cloud import near_by
from cloudjax_scenes.x3d.sights import middle_of, sight_of_columns
from tests.x3d_files import PLACE, SIZE_KM, write_small_sky


pytestmark = pytest.mark.slow

BROWSER = Path(__file__).parents[1] / "browser"
VIEW_FROM_ABOVE, PIXELS = 1, 240


@pytest.fixture(scope="module")
def modules() -> Path:
    """The folder of npm's packages x3dom, x_ite and puppeteer-core."""
    folder = os.environ.get("CLOUDJAX_NODE_MODULES")
    if not folder:
        pytest.skip("no browser: set CLOUDJAX_NODE_MODULES to a node_modules folder")
    for name in ("x3dom", "x_ite", "puppeteer-core"):
        if not (Path(folder) / name).is_dir():
            pytest.skip(f"no browser: {folder} lacks the npm package {name}")
    for program in ("node", "chromium"):
        if shutil.which(program) is None:
            pytest.skip(f"no browser: there is no {program}")
    return Path(folder)


@pytest.fixture(scope="module")
def sky(tmp_path_factory, modules):
    folder = write_small_sky(tmp_path_factory.mktemp("x3d"))
    shutil.copy(modules / "x3dom" / "x3dom.js", folder)
    return folder


def _look(modules, page, picture: Path, view=VIEW_FROM_ABOVE):
    """What the page said, and its picture."""
    command = "node", BROWSER / "look.js", page, picture, view, PIXELS, PIXELS
    done = subprocess.run(
        list(map(str, command)),
        env=os.environ | {"NODE_PATH": str(modules)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), imread(picture)[..., :3]


def test_the_page_opens_without_errors_or_a_network(sky, modules, tmp_path):
    said, picture = _look(modules, sky / "viewer.html", tmp_path / "p.png")
    assert said["asked"] == said["errors"] == []
    assert said["heap_mb"] < 200
    # White cloud over a dark sea.
    assert picture.max() > 0.7
    assert np.median(picture[100:140, 100:140]) < 0.5


def _black_and_white(sky: Path) -> Path:
    """The page with white clouds over black: it shows opacity."""

    def repainted(found: re.Match) -> str:
        image = imread(io.BytesIO(base64.b64decode(found[1])), format="png")
        image = np.array(image[..., :4])
        opaque = image.shape[-1] == 3 or image[..., 3].min() == 1
        image[..., :3] = 0 if opaque else 1
        file = io.BytesIO()
        imsave(file, np.rint(image * 255).astype(np.uint8), format="png")
        return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()

    text = (sky / "viewer.html").read_text(encoding="utf-8")
    text = re.sub(r"data:image/png;base64,([A-Za-z0-9+/=]+)", repainted, text)
    page = sky / "opacity.html"
    page.write_text(re.sub('skyColor="[^"]*"', 'skyColor="0 0 0"', text))
    return page


def test_the_screen_shows_the_renderer_s_opacity(sky, modules, tmp_path):
    """Its mean within 3 % of 1 - T for the same camera.

    Of lines of sight to the ground of the box: beyond it the model goes on, and boards
    do not.
    """
    _, picture = _look(modules, _black_and_white(sky), tmp_path / "p.png")
    frame = open_wrf(sky.parent / "wrfout").frames[0]
    world = ModelWorld(read_wrf(frame, PLACE), steps=8)
    box = Box(*middle_of(world.columns.grid), SIZE_KM * 1e3)
    scene = near_by(
        sight_of_columns(world, box, frame.time, "a model's own", (135.0, 40.0)).scene
    )
    document = (sky / "scene.x3d").read_text()
    height = re.search(r'"From above"[^>]*position="\S+ (\S+) \S+"', document)
    assert height is not None
    camera = Camera(
        box.latitude_deg,
        box.longitude_deg,
        float(height[1]),
        azimuth_deg=0.0,
        elevation_deg=-90.0,
        field_of_view_deg=45.0,
        rows=PIXELS,
        columns=PIXELS,
    )
    view = look(scene, camera, sun_over(*PLACE, zenith_deg=50.0, azimuth_deg=135.0))
    expected = np.asarray(products(scene, view).share.sum(0)).reshape(camera.shape)
    ground, _ = camera.rays().ground()
    places = ground.latitude_deg, ground.longitude_deg
    lands = box.local_m(ecef(*places, np.zeros(PIXELS**2)))
    inside = box.holds(lands).reshape(camera.shape)
    assert inside.mean() > 0.6
    found, expected = picture.mean(-1)[inside], expected[inside]
    assert found.mean() == pytest.approx(expected.mean(), rel=0.03)
    assert np.corrcoef(found, expected)[0, 1] > 0.95


@pytest.fixture
def served(sky, modules):
    """The address of the folder: X_ITE reads scenes from servers only."""
    link = sky / "x_ite"
    if not link.exists():
        link.symlink_to(modules / "x_ite" / "dist")
    handler = ft.partial(http.server.SimpleHTTPRequestHandler, directory=str(sky))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


@pytest.mark.parametrize("name", ["scene.x3d", "scene_geo.x3d"])
def test_x_ite_shows_the_scene(sky, modules, served, tmp_path, name):
    text = (BROWSER / "x_ite.html").read_text().replace("SCENE", name)
    (sky / "x_ite.html").write_text(text)
    said, picture = _look(modules, f"{served}/x_ite.html", tmp_path / "p.png")
    assert said["asked"] == []
    # The browser asks for an icon of the page.
    assert [e for e in said["errors"] if "404" not in e] == []
    sky_blue = np.array([0.36, 0.53, 0.78])
    other = np.abs(picture - sky_blue).max(-1) > 0.05
    assert other.mean() > 0.2
    assert picture[other].max() > 0.7
