"""X3D: the boards in the files are the renderer's cloud."""

import json
import os
import re
import struct
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import Rays, look, products, render, sun_over
from cloudjax.geometry.geodesy import east_north_up, ecef
from cloudjax_data import DataError, open_wrf, read_wrf
from cloudjax_scenes.model_scene import ModelWorld
from cloudjax_scenes.x3d.atlas import atlas_of
from cloudjax_scenes.x3d.boards import boards_of
from cloudjax_scenes.x3d.box import UP, Box, Picture, sectors
from cloudjax_scenes.x3d.colours import Exposure
from cloudjax_scenes.x3d.meshes import Tiles, board_meshes
from cloudjax_scenes.x3d.sections import section_places, share_out
from cloudjax_scenes.x3d.seen_cloud import SeenCloud, near_by, see_cloud
from cloudjax_scenes.x3d.sights import middle_of, sight_of_columns
from cloudjax_scenes.x3d.sky import ExportSettings
from cloudjax_scenes.x3d.voxels import voxels_of
from tests.x3d_files import PLACE, SIZE_KM, VOXELS, composite, shapes, write_small_sky


@pytest.fixture(scope="module")
def sky(tmp_path_factory):
    return write_small_sky(tmp_path_factory.mktemp("x3d"))


@pytest.fixture(scope="module")
def manifest(sky):
    return json.loads((sky / "manifest.json").read_text())


@pytest.fixture(scope="module")
def scene(sky):
    frame = open_wrf(sky.parent / "wrfout").frames[0]
    world = ModelWorld(read_wrf(frame, PLACE), steps=8)
    box = Box(*middle_of(world.columns.grid), SIZE_KM * 1e3)
    sight = sight_of_columns(world, box, frame.time, "a model's own", (135.0, 40.0))
    return near_by(sight.scene), box


def test_boards_do_not_mirror_the_sun(sky):
    """The sun is where a viewer from above sees it in the sea."""
    frame = open_wrf(sky.parent / "wrfout").frames[0]
    world = ModelWorld(read_wrf(frame, PLACE), steps=8)
    box = Box(*middle_of(world.columns.grid), SIZE_KM * 1e3)
    sight = sight_of_columns(world, box, frame.time, "a model's own", (0.0, 88.0))
    rays = _lines(UP.axes, np.zeros((1, 2)), box)

    def glint(scene):
        ground = look(scene, rays, sight.sun_direction).around.ground
        return scene.ground.seen(ground, scene.reflective, None).glint

    assert np.asarray(glint(sight.scene)).min() > 0.01
    assert glint(near_by(sight.scene)) is None


def _lines(axes, places, box) -> Rays:
    """Parallel lines of sight of pixels of 600 m, through places in a picture."""
    frame = east_north_up(box.latitude_deg, box.longitude_deg)
    place = np.array([[box.latitude_deg], [box.longitude_deg], [0.0]])
    start = np.column_stack([places, np.full(len(places), 8e5)]) @ axes @ frame
    direction = np.broadcast_to(-axes[2] @ frame, start.shape)
    return Rays(start + ecef(*place)[0], direction, 600 / 8e5)


def _places(sector: int, axes, span: float, count: int = 40) -> np.ndarray:
    """Places in the picture of a sector, at none of the pixels' middles."""
    rng = np.random.default_rng(sector)
    level = rng.uniform(-span, span, (count**2, 2))
    point = np.column_stack([level, rng.uniform(500, 2500, len(level))])
    return point @ axes[:2].T


@pytest.mark.parametrize("number", [0, 1, 4])
def test_boards_stop_the_light_that_the_renderer_stops(sky, scene, number):
    """Of the files alone, laid over each other, within 3 % of 1 - T over the box."""
    seen, box = scene
    sector = sectors(8)[number]
    places = _places(number, sector.axes, 14e3)
    rays = _lines(sector.axes, places, box)
    sun = sun_over(*PLACE, zenith_deg=50.0, azimuth_deg=135.0)
    expected = np.asarray(products(seen, look(seen, rays, sun)).share.sum(0), float)
    through, _ = composite(sky, number, sector.axes, places)
    assert expected.mean() > 0.05
    assert (1 - through).mean() == pytest.approx(expected.mean(), rel=0.03)
    assert np.corrcoef(1 - through, expected)[0, 1] > 0.95


def test_opacities_are_of_the_physical_extinction(scene):
    """Light that calls half of it extinction: twice the optical depth that it marches.

    Tolerance: 2 %, for steps that nobody sees are left out.
    """
    seen, box = scene
    picture = Picture.of(box, UP, 2e3, (0.0, 4e3))
    sun = sun_over(*PLACE, zenith_deg=50.0, azimuth_deg=135.0)
    plain, half = (
        see_cloud(seen, picture, sun, extinction_share=share).column_depth
        for share in (1.0, 0.5)
    )
    thin = (plain > 0.05) & (plain < 3)
    assert thin.sum() > 5
    np.testing.assert_allclose(half[thin], 2 * plain[thin], rtol=0.02)


def test_boards_over_the_ground_look_as_rendered(sky, scene):
    seen, box = scene
    axes = UP.axes
    places = _places(0, axes, 14e3)
    sun = sun_over(*PLACE, zenith_deg=50.0, azimuth_deg=135.0)
    image = render(seen, _lines(axes, places, box), sun).radiances.reflective
    exposure = Exposure.of_sun(np.sin(np.radians(40)))
    reflectance = np.asarray(seen.reflective.reflectance(jnp.asarray(image)), float)
    expected = np.clip(exposure.screen((1, 2, 3), reflectance), 0, 1)
    through, colour = composite(sky, 0, axes, places)
    ground = np.asarray(_ground(sky), float)
    found = colour + through[:, None] * ground
    assert np.abs(found - expected).mean() < 0.01
    assert np.corrcoef(found[:, 1], expected[:, 1])[0, 1] > 0.98


def _ground(sky):
    from matplotlib.image import imread

    image = imread(sky / "textures/ground.png")
    # The sea is the same everywhere.
    assert np.ptp(image.reshape(-1, image.shape[-1]), axis=0).max() < 0.02
    return image[0, 0, :3]


def test_the_manifest_tells_what_the_files_hold(sky, manifest):
    assert manifest["clouds"] == 2
    assert manifest["sources"] == ["wrfout"]
    assert manifest["sun"] == {"azimuth_deg": 135.0, "elevation_deg": 40.0}
    for i, sector in enumerate(manifest["sectors"].values()):
        for level, count in enumerate(sector["boards"]):
            drawn = sum(len(corners) for corners, _, _ in shapes(sky, i, level))
            assert drawn == count <= manifest["boards"]
        mean = sector["mean_opacity"]
        assert mean["boards"] == pytest.approx([mean["source"]] * 3, rel=0.01)
        assert sector["greatest_difference_of_opacity"] < 0.01


def test_documents_are_valid_by_the_official_schema(sky, shared_data):
    etree = pytest.importorskip("lxml.etree", reason="lxml is absent")
    schema = etree.XMLSchema(etree.parse(shared_data / "x3d_schema/x3d-4.0.xsd"))
    for name in ("scene.x3d", "scene_geo.x3d", "scene_volume.x3d"):
        schema.assertValid(etree.parse(sky / name))


def _looking(element: ET.Element) -> np.ndarray:
    """Where a viewpoint looks: along -z, turned about its axis (Rodrigues)."""
    *axis, angle = map(float, (element.get("orientation") or "").split())
    k, v = np.array(axis), np.array([0, 0, -1.0])
    return (
        v * np.cos(angle)
        + np.cross(k, v) * np.sin(angle)
        + k * (k @ v) * (1 - np.cos(angle))
    )


def test_viewpoints_look_at_the_clouds(sky, scene):
    _, box = scene
    views = list(ET.parse(sky / "scene.x3d").getroot().iter("Viewpoint"))
    geo = list(ET.parse(sky / "scene_geo.x3d").getroot().iter("GeoViewpoint"))
    assert len(views) == len(geo) == 5
    for plain, round_ in zip(views, geo, strict=True):
        eye = np.array((plain.get("position") or "").split(), float)
        centre = np.array((plain.get("centerOfRotation") or "").split(), float)
        ahead = (centre - eye) / np.linalg.norm(centre - eye)
        np.testing.assert_allclose(_looking(plain), ahead, atol=1e-4)
        place = np.array((round_.get("position") or "").split(), float)
        here = ecef(*place[:, None])[0]
        # East, up and south of where the viewer is.
        line = east_north_up(*place[:2]) @ (box.ecef_m(centre[[0, 2, 1]]) - here)
        line = line[[0, 2, 1]] * [1, 1, -1] / np.linalg.norm(line)
        np.testing.assert_allclose(_looking(round_), line, atol=1e-3)


def test_the_globe_has_the_clouds_where_they_are(sky, scene):
    _, box = scene
    root = ET.parse(sky / "scene_geo.x3d").getroot()
    location = root.find(".//GeoLocation")
    assert location is not None
    place = [float(x) for x in (location.get("geoCoords") or "").split()]
    np.testing.assert_allclose(place[:2], [box.latitude_deg, box.longitude_deg], 1e-6)
    plain, globe = (list(shapes(sky, 0, file=f)) for f in ("scene.x3d", root_name(sky)))
    for one, other in zip(plain, globe, strict=True):
        np.testing.assert_array_equal(one[0], other[0])


def root_name(sky) -> str:
    return (sky / "scene_geo.x3d").name


def test_every_route_and_use_has_its_node(sky):
    for name in ("scene.x3d", "scene_geo.x3d"):
        root = ET.parse(sky / name).getroot()
        defined = [e.get("DEF") for e in root.iter() if e.get("DEF")]
        assert len(set(defined)) == len(defined)
        used = {e.get("USE") for e in root.iter() if e.get("USE")}
        ends = {e.get(k) for e in root.iter("ROUTE") for k in ("fromNode", "toNode")}
        assert used | ends <= set(defined)
        fields = {e.get("name") for e in root.iter("field")}
        routed = {e.get("fromField") for e in root.iter("ROUTE")}
        assert routed <= fields | {"position_changed"}


def test_the_page_asks_for_nothing_but_the_library(sky, manifest):
    text = (sky / "viewer.html").read_text(encoding="utf-8")
    assert re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="([^"]+)"', text) == [
        "x3dom.js"
    ]
    urls = re.findall(r'url="&quot;([^"]{10})', text)
    textures = 1 + 3 * len(manifest["sectors"])
    assert len(urls) == textures
    assert set(urls) == {"data:image"}


def _haze(box: Box) -> SeenCloud:
    """Three pieces on each ray of a small picture, some deep."""
    picture = Picture(box, UP, -4e3, 4e3, 1e3, (8, 8))
    ray = np.repeat(np.arange(64), 3)
    row, column = np.divmod(ray, 8)
    height = np.tile([3e3, 2e3, 1e3], 64)
    place = np.column_stack([-3.5e3 + 1e3 * column, 3.5e3 - 1e3 * row, height])
    depth = np.random.default_rng(0).gamma(0.3, 2.0, len(ray))
    length, none = np.full(len(ray), 800.0), np.zeros((1, 64))
    return SeenCloud(picture, ray, place, depth, length, none, none, np.zeros(64))


def test_sections_share_out_all_of_the_optical_depth():
    haze = _haze(Box(0.0, 0.0, 8e3))
    places = section_places(haze, 30)
    assert len(places) == 30
    sections = share_out(haze, places)
    np.testing.assert_allclose(sections.depth.sum(0), haze.column_depth, rtol=1e-12)


def test_cloud_thinner_than_a_byte_has_no_boards():
    haze = _haze(Box(0.0, 0.0, 8e3))
    sections = share_out(haze, section_places(haze, 30))
    sections.depth.data[:] = 1e-6
    boards = boards_of(haze.picture, sections)
    atlas = atlas_of(boards, np.zeros((8, 8, 3), np.uint8))
    assert atlas.image.shape == (1, 1, 4)
    assert not list(board_meshes(boards, atlas, Tiles(haze.picture.box, 2)))


@pytest.mark.parametrize("coarser", [1, 2])
def test_bytes_of_many_thin_boards_add_up(coarser):
    """Rounded one by one, 30 boards would be off by several bytes."""
    haze = _haze(Box(0.0, 0.0, 8e3))
    boards = boards_of(haze.picture, share_out(haze, section_places(haze, 30)), coarser)
    through = np.exp(-haze.column_depth).reshape(8 // coarser, coarser, -1, coarser)
    np.testing.assert_allclose(
        boards.opacity(), 1 - through.mean((1, 3)), atol=1.1 / 255
    )
    depths = [board.middle_m[2] for board in boards.boards]
    assert depths == sorted(depths)


def test_voxels_hold_what_the_pieces_hold():
    """Each piece in the columns of its pixel, from its lower to its upper end."""
    haze = _haze(Box(0.0, 0.0, 8e3))
    voxels = voxels_of(haze, 8)
    assert (voxels.low_m, voxels.high_m) == (600.0, 3400.0)
    column = haze.column_depth.reshape(8, 8)
    np.testing.assert_allclose(voxels.depth.sum(axis=0), column, rtol=1e-12)
    # Levels of 350 m; the lowest piece is from 600 to 1400 m, the next from 1600 m on.
    middle, lowest = (haze.depth[i::3].reshape(8, 8) for i in (1, 2))
    np.testing.assert_allclose(voxels.depth[1], lowest * 350 / 800)
    np.testing.assert_allclose(voxels.depth[2], (lowest * 100 + middle * 50) / 800)
    # Of four pixels a voxel has the mean.
    coarse = voxels_of(haze, 4).depth.sum(axis=0)
    np.testing.assert_allclose(coarse, column.reshape(4, 2, 4, 2).mean((1, 3)))


def test_slices_of_the_volume_let_as_much_light_pass_as_the_cloud(sky, manifest):
    """400 slices across the diagonal of the box, straight down, with the opacities in
    the file; the source is the manifest's mean from above.

    Tolerance: 10 %, for a slice has 255 steps of opacity, a voxel the mean depth of
    nine pixels, and the picture of the source is wider than the box.
    """
    root = ET.parse(sky / "scene_volume.x3d").getroot()
    volume, texture = root.find(".//VolumeData"), root.find(".//PixelTexture3D")
    assert volume is not None
    assert texture is not None
    size = np.array((volume.get("dimensions") or "").split(), float)
    values = np.array((texture.get("image") or "").split(), int)
    assert values[:4].tolist() == [1, VOXELS, VOXELS, VOXELS]
    # Slices to the south, rows upwards, columns to the east.
    opacity = values[4:].reshape(VOXELS, VOXELS, VOXELS) / 255
    slices = 399 / np.linalg.norm(size) * size[1] / VOXELS
    through = ((1 - opacity) ** slices).prod(axis=1)
    found = 1 - through.mean()
    assert manifest["volume"]["mean_opacity"] == pytest.approx(found, rel=1e-3)
    up = manifest["sectors"]["up"]["mean_opacity"]["source"]
    assert found == pytest.approx(up, rel=0.1)
    # The thick cloud is in the north-east, the thin one in the south-west.
    north_east, south_west = through[:8, 8:], through[8:, :8]
    assert north_east.min() < 0.5 * south_west.min()


@pytest.mark.parametrize(("count", "said"), [(7, "8 to 128"), (200, "8 to 128")])
def test_volumes_have_limits(count, said):
    with pytest.raises(DataError, match=said):
        ExportSettings(volume=count)
    with pytest.raises(DataError, match="--pixels 64 or more"):
        ExportSettings(volume=64, pixels=48)


def _glb(sky):
    """The JSON of scene.glb, and its arrays by accessor."""
    content = (sky / "scene.glb").read_bytes()
    magic, version, whole, size, kind = struct.unpack_from("<4sIII4s", content)
    assert (magic, version, whole, kind) == (b"glTF", 2, len(content), b"JSON")
    document, binary = json.loads(content[20 : 20 + size]), content[28 + size :]
    assert struct.unpack_from("<I4s", content, 20 + size) == (len(binary), b"BIN\0")
    assert document["buffers"] == [{"byteLength": len(binary)}]

    def view(number):
        one = document["bufferViews"][number]
        assert one["byteOffset"] % 4 == 0
        return binary[one["byteOffset"] :][: one["byteLength"]]

    widths, kinds = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}, {5126: "<f4", 5125: "<u4"}
    arrays = [
        np.frombuffer(view(one["bufferView"]), kinds[one["componentType"]]).reshape(
            one["count"], widths[one["type"]]
        )
        for one in document["accessors"]
    ]
    return document, arrays, [view(image["bufferView"]) for image in document["images"]]


def test_gltf_has_the_boards_from_above(sky):
    """The same corners, texture and opacity as the scene, in glTF's own conventions."""
    document, arrays, images = _glb(sky)
    ground, clouds = (mesh["primitives"][0] for mesh in document["meshes"])
    assert [m["alphaMode"] for m in document["materials"]] == ["OPAQUE", "BLEND"]
    assert images[1] == (sky / "textures/level0_up.png").read_bytes()
    x, y, z = arrays[clouds["attributes"]["POSITION"]].T
    found = np.stack([x, -z, y], axis=-1).reshape(-1, 4, 3)
    corners, inside = (
        np.concatenate(part) for part in list(zip(*shapes(sky, 0), strict=True))[:2]
    )
    assert len(found) == len(corners)
    one, other = (
        np.lexsort((c[:, 0, 2], *np.round(c[:, [0, 2], :2]).reshape(-1, 4).T))
        for c in (found, corners)
    )
    np.testing.assert_allclose(found[one], corners[other], atol=0.06)
    # Textures of glTF begin at the upper left.
    texture = arrays[clouds["attributes"]["TEXCOORD_0"]].reshape(-1, 4, 2)[one]
    expected = inside[other] * [1, -1] + [0, 1]
    np.testing.assert_allclose(texture, expected, atol=1e-5)
    corner = arrays[clouds["indices"]].reshape(-1, 3)
    assert corner.max() == 4 * len(found) - 1
    bounds = document["accessors"][ground["attributes"]["POSITION"]]
    assert bounds["max"][0] == pytest.approx(SIZE_KM * 500, rel=1e-3)


def test_gltf_is_valid_by_the_validator_of_khronos(sky):
    modules = os.environ.get("CLOUDJAX_NODE_MODULES", "")
    if not (Path(modules) / "gltf-validator").is_dir():
        pytest.skip("CLOUDJAX_NODE_MODULES has no npm package gltf-validator")
    code = (
        "require('gltf-validator').validateBytes(new Uint8Array(require('fs')"
        ".readFileSync(process.argv[1]))).then(r => console.log(r.issues.numErrors, "
        "r.issues.numWarnings))"
    )
    done = subprocess.run(
        ["node", "-e", code, sky / "scene.glb"],
        env=os.environ | {"NODE_PATH": modules},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["0", "0"]
