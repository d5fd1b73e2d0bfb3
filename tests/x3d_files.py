"""A small sky of a generated model, and what is seen of its files by numpy alone."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from matplotlib.image import imread

from tests.commands import run
from tests.generated_wrf import LEVELS, write_wrf


PLACE = (20.0, -80.0)
ROWS = COLUMNS = 12
SIZE_KM, PIXELS, BOARDS = 30, 48, 60
VOXELS = 16
SMALL = ("--steps", 8, "--pixels", PIXELS, "--sun", "135,40")


def write_model(folder: Path) -> Path:
    """Two clouds, one thick and one thin, 3 km columns and 1 km levels."""
    y, x = np.mgrid[:ROWS, :COLUMNS]
    cloud = np.zeros((LEVELS, ROWS, COLUMNS))
    cloud[1] = 2e-5 * np.exp(-((y - 2) ** 2 + (x - 2) ** 2) / 2)
    cloud[2] = 5e-4 * np.exp(-((y - 8) ** 2 + (x - 8) ** 2) / 2)
    cloud[cloud < 1e-6] = 0
    level = np.zeros((ROWS, COLUMNS))
    return write_wrf(folder / "wrfout", latitude=level, QCLOUD=cloud)


def write_small_sky(folder: Path) -> Path:
    """The folder that the command line writes of it."""
    place = "--place", ",".join(map(str, PLACE))
    box = "--size-km", SIZE_KM, "--boards", BOARDS, "--volume", VOXELS
    model = write_model(folder)
    result = run("x3d", "--wrf", model, *place, *box, *SMALL, "-o", folder / "sky")
    assert result.exit_code == 0, result.output
    return folder / "sky"


def shapes(folder: Path, sector: int, level: int = 0, file: str = "scene.x3d"):
    """Corners, texture coordinates and textures of what a sector shows, tile by tile.

    In metres to the east, to the north and upwards.
    """
    root = ET.parse(folder / file).getroot()
    urls = {
        texture.get("DEF"): (texture.get("url") or "").strip('"')
        for texture in root.iter("ImageTexture")
        if texture.get("DEF")
    }
    group = root.find(f".//Group[@DEF='level{level}']")
    assert group is not None
    for switch in group.findall("Switch"):
        shape = list(switch)[sector]
        if shape.tag != "Shape":
            continue
        texture = shape.find("Appearance/ImageTexture")
        point, inside = shape.find(".//Coordinate"), shape.find(".//TextureCoordinate")
        assert texture is not None
        assert point is not None
        assert inside is not None
        name = texture.get("DEF") or texture.get("USE")
        x, y, z = _numbers(point, 3).T
        corners = np.stack([x, -z, y], axis=-1).reshape(-1, 4, 3)
        image = np.asarray(imread(folder / urls[name]), float)
        yield corners, _numbers(inside, 2).reshape(-1, 4, 2), image


def _numbers(element: ET.Element, each: int) -> np.ndarray:
    return np.array((element.get("point") or "").split(), float).reshape(-1, each)


def composite(folder: Path, sector: int, axes: np.ndarray, places: np.ndarray):
    """What boards let pass, and the colour that they add, along parallel lines.

    **Arguments:**

    - `axes`: to the right, to the top and to the viewer.
    - `places`: right and top of each line [m].
    """
    through, colour = np.ones(len(places)), np.zeros((len(places), 3))
    for corners, inside, image in shapes(folder, sector):
        across = corners @ axes[:2].T
        for corner, texture in zip(across, inside, strict=True):
            low, high = corner[0], corner[2]
            part = (places - low) / (high - low)
            on = np.flatnonzero(((part >= 0) & (part < 1)).all(-1))
            at = texture[0] + part[on] * (texture[2] - texture[0])
            height, width = image.shape[:2]
            row = np.clip(((1 - at[:, 1]) * height).astype(int), 0, height - 1)
            column = np.clip((at[:, 0] * width).astype(int), 0, width - 1)
            texel = image[row, column]
            alpha = texel[:, 3:]
            colour[on] = texel[:, :3] * alpha + (1 - alpha) * colour[on]
            through[on] *= 1 - alpha[:, 0]
    return through, colour
