"""X3D in a real browser: Chromium, X3DOM and X_ITE, where they are installed."""

import base64
import io
import os
import re
import shutil
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.image import imread, imsave

from cloudjax import Camera, look, products, render, sun_over
from cloudjax.geometry.geodesy import ecef
from cloudjax_data import open_wrf, read_wrf
from cloudjax_scenes.model_scene import ModelWorld
from cloudjax_scenes.x3d.box import Box
from cloudjax_scenes.x3d.colours import Exposure
from cloudjax_scenes.x3d.seen_cloud import near_by
from cloudjax_scenes.x3d.sights import middle_of, sight_of_columns
from tests import browsing
from tests.x3d_files import PLACE, SIZE_KM, write_small_sky


pytestmark = pytest.mark.slow

VIEW_FROM_ABOVE, PIXELS = 1, 240
SUN_ELEVATION_DEG = 40.0


@pytest.fixture(scope="module")
def modules() -> Path:
    """The folder of npm's packages x3dom, x_ite and puppeteer-core."""
    folder = os.environ.get("CLOUDJAX_NODE_MODULES")
    lacks = browsing.missing_browser(folder)
    if folder is None or lacks:
        pytest.skip(f"no browser: {lacks}")
    return Path(folder)


@pytest.fixture(scope="module")
def sky(tmp_path_factory, modules):
    folder = write_small_sky(tmp_path_factory.mktemp("x3d"))
    shutil.copy(modules / "x3dom" / "x3dom.js", folder)
    return folder


def _look(modules, page, picture: Path, view=VIEW_FROM_ABOVE):
    """What the page said, and its picture."""
    said = browsing.look(modules, page, picture, view, (PIXELS, PIXELS))
    return said, imread(picture)[..., :3]


def test_the_page_opens_without_errors_or_a_network(sky, modules, tmp_path):
    said, picture = _look(modules, sky / "viewer.html", tmp_path / "p.png")
    assert said["asked"] == said["errors"] == []
    assert said["heap_mb"] < 200
    # White cloud over a dark sea.
    assert picture.max() > 0.7
    assert np.median(picture[100:140, 100:140]) < 0.5


class Seen:
    """What the renderer sees of the box with the camera of the view from above.

    Of lines of sight to the ground of the box: beyond it the model goes on, and boards
    do not.
    """

    def __init__(self, sky: Path):
        frame = open_wrf(sky.parent / "wrfout").frames[0]
        world = ModelWorld(read_wrf(frame, PLACE), steps=8)
        box = Box(*middle_of(world.columns.grid), SIZE_KM * 1e3)
        sun_deg = (135.0, SUN_ELEVATION_DEG)
        sight = sight_of_columns(world, box, frame.time, "a model's own", sun_deg)
        self.scene = near_by(sight.scene)
        document = (sky / "scene.x3d").read_text()
        height = re.search(r'"From above"[^>]*position="\S+ (\S+) \S+"', document)
        assert height is not None
        self.camera = Camera(
            box.latitude_deg,
            box.longitude_deg,
            float(height[1]),
            azimuth_deg=0.0,
            elevation_deg=-90.0,
            field_of_view_deg=45.0,
            rows=PIXELS,
            columns=PIXELS,
        )
        zenith_deg = 90 - SUN_ELEVATION_DEG
        self.sun = sun_over(*PLACE, zenith_deg=zenith_deg, azimuth_deg=135.0)
        ground, _ = self.camera.rays().ground()
        places = ground.latitude_deg, ground.longitude_deg
        lands = box.local_m(ecef(*places, np.zeros(PIXELS**2)))
        self.inside = box.holds(lands).reshape(self.camera.shape)
        assert self.inside.mean() > 0.6

    def opacity(self) -> np.ndarray:
        """1 - T of each line of sight."""
        share = products(self.scene, look(self.scene, self.camera, self.sun)).share
        return np.asarray(share.sum(0)).reshape(self.camera.shape)[self.inside]

    def luminance(self) -> np.ndarray:
        """Brightness on a screen, 0 to 1."""
        image = render(self.scene, self.camera, self.sun).radiances.reflective
        bands = self.scene.reflective
        assert image is not None
        assert bands is not None
        reflectance = np.asarray(bands.reflectance(jnp.asarray(image)), float)
        exposure = Exposure.of_sun(np.sin(np.radians(SUN_ELEVATION_DEG)))
        numbers = bands.numbers
        colour = exposure.screen(numbers, reflectance.reshape(len(numbers), -1))
        grey = np.clip(colour, 0, 1).mean(-1)
        return grey.reshape(self.camera.shape)[self.inside]


@pytest.fixture(scope="module")
def seen(sky) -> Seen:
    return Seen(sky)


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


def test_the_screen_shows_the_renderer_s_opacity(sky, seen, modules, tmp_path):
    """Its mean within 3 % of 1 - T for the same camera."""
    _, picture = _look(modules, _black_and_white(sky), tmp_path / "p.png")
    found, expected = picture.mean(-1)[seen.inside], seen.opacity()
    assert found.mean() == pytest.approx(expected.mean(), rel=0.03)
    assert np.corrcoef(found, expected)[0, 1] > 0.95


def test_the_screen_is_as_bright_as_rendered(sky, seen, modules, tmp_path):
    """Luminance for the same camera: correlated above 0.9, its mean within 5 %.

    Half a percent of that mean is a byte; what is left is where boards stand.
    """
    _, picture = _look(modules, sky / "viewer.html", tmp_path / "p.png")
    found, expected = picture.mean(-1)[seen.inside], seen.luminance()
    assert found.mean() == pytest.approx(expected.mean(), rel=0.05)
    assert np.corrcoef(found, expected)[0, 1] > 0.9


@pytest.mark.parametrize("name", ["scene.x3d", "scene_geo.x3d", "scene_volume.x3d"])
def test_x_ite_shows_the_scene(sky, modules, tmp_path, name):
    with browsing.served(sky, modules) as address:
        page = f"{address}/{browsing.x_ite_page(sky, name)}"
        said, picture = _look(modules, page, tmp_path / "p.png")
    assert said["asked"] == []
    # The browser asks for an icon of the page.
    assert [e for e in said["errors"] if "404" not in e] == []
    sky_blue = np.array([0.36, 0.53, 0.78])
    other = np.abs(picture - sky_blue).max(-1) > 0.05
    assert other.mean() > 0.2
    assert picture[other].max() > 0.7
