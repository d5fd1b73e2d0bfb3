"""The folder of a sky: scenes, textures, a page and what is known of them."""

import json
import os
import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from cloudjax_data import DataError
from cloudjax_data.whole_files import require_writable, staged

from .box import UP
from .document import GROUND, document
from .flight import Flight
from .gltf import glb
from .sky import TEXTURES, ExportSettings, MadeSky, Sight, make_sky
from .viewer import LIBRARY, page
from .volume_document import volume_document


MANIFEST = "manifest.json"
VOLUME, GLTF = "scene_volume.x3d", "scene.glb"
_PAGES = ("scene.x3d", "scene_geo.x3d", VOLUME, GLTF, "viewer.html")


def write_sky(
    folder: str | os.PathLike[str],
    sight: Sight,
    settings: ExportSettings | None = None,
    *,
    flight: Flight | None = None,
    library: str | os.PathLike[str] | None = None,
    on_tile: Callable[[int, int], None] | None = None,
) -> Mapping:
    """Write scene.x3d, scene_geo.x3d, scene.glb, viewer.html, textures, manifest.json.

    And scene_volume.x3d, where the settings ask for it.

    **Arguments:**

    - `flight`: of a viewpoint that flies.
    - `library`: x3dom.js, which is copied beside the page.
    - `on_tile`: as of `make_sky`.

    **Returns:** what manifest.json has.

    **Raises:** `DataError` where there is no cloud or no sun, for too few boards, for a
    flight elsewhere, and if the disk does not take the files.
    """
    settings, folder = settings or ExportSettings(), Path(folder)
    require_writable(folder)
    if library is not None and not Path(library).is_file():
        raise DataError(f"{library} is no file: give the x3dom.js of a viewer.")
    if flight is not None:
        flight.require_near(sight.box)
    made = make_sky(sight, settings, on_tile)
    sky = made.sky if flight is None else replace(made.sky, flight=flight)
    # Nothing of an earlier run may look like a part of this one.
    for name in (MANIFEST, *_PAGES):
        (folder / name).unlink(missing_ok=True)
    with staged(folder / TEXTURES) as aside:
        for address, image in made.images.items():
            (aside / Path(address).name).write_bytes(image)
    with staged(folder, last=MANIFEST) as aside:
        (aside / "scene.x3d").write_bytes(document(sky))
        (aside / "scene_geo.x3d").write_bytes(document(sky, geographic=True))
        if made.voxels is not None:
            (aside / VOLUME).write_bytes(volume_document(sky, made.voxels))
        (aside / GLTF).write_bytes(_from_above(made))
        text = page(sky, made.images, sky.about["title"])
        (aside / "viewer.html").write_text(text, encoding="utf-8")
        if library is not None:
            shutil.copyfile(library, aside / LIBRARY)
        (aside / MANIFEST).write_text(json.dumps(made.manifest, indent=2) + "\n")
    return made.manifest


def _from_above(made: MadeSky) -> bytes:
    """The ground, and over it the boards from above, as glTF."""
    sky = made.sky
    parts = {GROUND: (sky.ground, made.images[sky.ground_texture])}
    if made.from_above is not None:
        texture = sky.levels[0].textures[UP.name]
        parts["clouds"] = made.from_above, made.images[texture]
    place = {
        "latitude_deg": sky.box.latitude_deg,
        "longitude_deg": sky.box.longitude_deg,
    }
    return glb(parts, {**sky.about, **place})
