"""The page that shows the scene in a browser, offline."""

import base64
import html
import importlib.resources
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import replace
from string import Template

from .document import GROUND, Sky, choice_code, choices, scene_element
from .flight_nodes import CLOCK, FLIER


# The library of the browser, which has to lie beside the page.
LIBRARY = "x3dom.js"


def page(sky: Sky, images: Mapping[str, bytes], title: str) -> str:
    """Make the page.

    Browsers refuse pictures from files beside a page that is opened from a folder, so
    the page holds them itself.

    **Arguments:** `images`: PNG files by their addresses in the scene.
    """
    inline = {
        address: "data:image/png;base64," + base64.b64encode(image).decode()
        for address, image in images.items()
    }
    levels = tuple(
        replace(
            level, textures={name: inline[url] for name, url in level.textures.items()}
        )
        for level in sky.levels
    )
    shown = replace(sky, levels=levels, ground_texture=inline[sky.ground_texture])
    scene = scene_element(shown)
    _suit_x3dom(scene)
    text = ET.tostring(scene, encoding="unicode", short_empty_elements=False)
    template = importlib.resources.files("cloudjax_scenes.x3d").joinpath("viewer.html")
    return Template(template.read_text(encoding="utf-8")).substitute(
        title=html.escape(title),
        library=LIBRARY,
        scene=text,
        choice=choice_code(sky),
        middle=f"{sky.top_m / 2:.0f}",
        tiles=str(choices(sky)),
        flier=FLIER,
        clock=CLOCK,
        about="".join(
            f"<dt>{html.escape(name)}</dt><dd>{html.escape(value)}</dd>"
            for name, value in sky.about.items()
        ),
    )


def _suit_x3dom(scene: ET.Element) -> None:
    """Change what X3DOM does otherwise than X3D says."""
    # It runs no scripts of scenes: the page turns the boards. It does not say when a
    # viewpoint is chosen: the page starts the clock.
    own = {script.get("DEF") for script in scene.findall("Script")} | {FLIER}
    for script in scene.findall("Script"):
        scene.remove(script)
    for route in scene.findall("ROUTE"):
        if route.get("fromNode") in own or route.get("toNode") in own - {FLIER}:
            scene.remove(route)
    for appearance in scene.iter("Appearance"):
        # It knows no unlit material, and takes no light for shapes without any.
        for material in appearance.findall("UnlitMaterial"):
            appearance.remove(material)
        texture = appearance.find("ImageTexture")
        name = "" if texture is None else texture.get("DEF", texture.get("USE", ""))
        # It takes every PNG for transparent, and lets what is so hide what is behind.
        clear = name != GROUND
        appearance.set("sortType", "transparent" if clear else "opaque")
        if clear:
            # It leaves out what is less than a tenth opaque, which is most of a haze.
            appearance.set("alphaClipThreshold", "0")
            ET.SubElement(appearance, "DepthMode", readOnly="true")
