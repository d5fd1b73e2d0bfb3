"""The X3D document, with plain transforms or with geographic ones."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cloudjax.geometry.geodesy import east_north_up, geodetic

from .box import STEEP_DEG, Box, Sector
from .fields import AXES, GEO_SYSTEM, decimal, decimals, looking, rotation
from .flight import Flight
from .flight_nodes import add_flight
from .meshes import Mesh, Tiles


_SCHEMA = "https://www.web3d.org/specifications/x3d-4.0.xsd"
# Name of its texture.
GROUND = "ground"


@dataclass(frozen=True, eq=False)
class Level:
    """A `Level` is the whole sky at one level of detail.

    **Fields:**

    - `tiles`: into which it is cut.
    - `meshes`: of the tile's number and the sector's name.
    - `textures`: addresses, by the sector's name.
    - `from_m`: the distance from which it serves.
    """

    tiles: Tiles
    meshes: Mapping[tuple[int, str], Mesh]
    textures: Mapping[str, str]
    from_m: float


@dataclass(frozen=True, eq=False)
class Sky:
    """A `Sky` is all that a document shows.

    **Fields:**

    - `box`, `sectors`: where, and from where boards are looked at.
    - `levels`: of detail, the finest first.
    - `ground`, `ground_texture`: below.
    - `top_m`: the highest cloud.
    - `about`: what the document says of itself, by name.
    - `flight`: of one more viewpoint, None for none.
    """

    box: Box
    sectors: Sequence[Sector]
    levels: Sequence[Level]
    ground: Mesh
    ground_texture: str
    top_m: float
    about: Mapping[str, str]
    flight: Flight | None = None


def scene_element(sky: Sky, *, geographic: bool = False) -> ET.Element:
    """Make the scene.

    **Arguments:** `geographic`: stand it on the globe by `GeoLocation`; else its origin
    is the centre of the box on the ground, x to the east, y up and z to the south.
    """
    scene, world = stage(sky, geographic=geographic)
    _clouds(world, sky)
    _turning(scene, world, sky)
    return scene


def stage(sky: Sky, *, geographic: bool = False) -> tuple[ET.Element, ET.Element]:
    """Make a scene without its clouds, and the node for them."""
    scene = ET.Element("Scene")
    ET.SubElement(
        scene,
        "NavigationInfo",
        # The first speed is metres in a second.
        speed=decimal(sky.box.size_m / 10),
        type='"EXAMINE" "FLY" "ANY"',
        headlight="false",
        # Between them viewers draw: planes as near and as far as a flight needs.
        avatarSize=f"{decimal(sky.box.size_m / 2000)} 1.6 0.75",
        visibilityLimit=decimal(sky.box.size_m * 20),
    )
    ET.SubElement(scene, "Background", skyColor="0.36 0.53 0.78")
    _viewpoints(scene, sky, geographic)
    if sky.flight is not None:
        add_flight(scene, sky.flight, sky.box, geographic=geographic)
    world = _anchor(scene, sky.box, geographic)
    _shape(world, GROUND, sky.ground, sky.ground_texture, clear=False)
    return scene, world


def document(sky: Sky, *, geographic: bool = False) -> bytes:
    """Make a whole file, X3D 4.0 in XML."""
    profile = "Full" if geographic else "Immersive"
    return whole_file(scene_element(sky, geographic=geographic), sky.about, profile)


def whole_file(scene: ET.Element, about: Mapping[str, str], profile: str) -> bytes:
    """Write a scene, and what it says of itself, as a file."""
    root = ET.Element(
        "X3D",
        {
            "profile": profile,
            "version": "4.0",
            "xmlns:xsd": "http://www.w3.org/2001/XMLSchema-instance",
            "xsd:noNamespaceSchemaLocation": _SCHEMA,
        },
    )
    head = ET.SubElement(root, "head")
    for name, content in about.items():
        ET.SubElement(head, "meta", name=name, content=content)
    root.append(scene)
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def _anchor(scene: ET.Element, box: Box, geographic: bool) -> ET.Element:
    if not geographic:
        return ET.SubElement(scene, "Transform", DEF="clouds")
    return ET.SubElement(
        scene,
        "GeoLocation",
        DEF="clouds",
        geoSystem=GEO_SYSTEM,
        geoCoords=f"{box.latitude_deg:.7f} {box.longitude_deg:.7f} 0",
    )


def views(sky: Sky) -> Mapping[str, tuple[float, float, float]]:
    """Return azimuth and elevation [degrees] and distance [m] of viewers, by name."""
    far = 1.35 * sky.box.size_m
    return {
        "From the south, high": (180.0, 35.0, far),
        "From above": (180.0, 90.0, far),
        "From the south-east, low": (135.0, 12.0, far),
        "From the west": (270.0, 20.0, far),
        "From the north": (0.0, 25.0, far),
    }


def _viewpoints(scene: ET.Element, sky: Sky, geographic: bool) -> None:
    for name, (azimuth, elevation, far) in views(sky).items():
        towards = Sector(name, azimuth, elevation).axes[2]
        eye = far * towards + [0, 0, sky.top_m / 2]
        if geographic:
            _geographic_viewpoint(scene, name, sky.box, eye, towards)
        else:
            ET.SubElement(
                scene,
                "Viewpoint",
                description=name,
                orientation=rotation(azimuth, elevation),
                position=decimals(eye @ AXES.T),
                centerOfRotation=decimals([0.0, sky.top_m / 2, 0.0]),
            )


def _geographic_viewpoint(scene: ET.Element, name: str, box: Box, eye, towards) -> None:
    latitude, longitude, altitude = (
        float(x[0]) for x in geodetic(box.ecef_m(eye[None]))
    )
    # Its orientation is that about its own place, where another way is up.
    ahead = east_north_up(latitude, longitude) @ -(towards @ box.axes)
    ET.SubElement(
        scene,
        "GeoViewpoint",
        description=name,
        orientation=looking(ahead),
        geoSystem=GEO_SYSTEM,
        position=f"{latitude:.7f} {longitude:.7f} {altitude:.1f}",
    )


def _clouds(world: ET.Element, sky: Sky) -> None:
    ranges = [decimal(level.from_m) for level in sky.levels[1:]]
    parent = world
    if ranges:
        parent = ET.SubElement(world, "LOD", DEF="detail", range=" ".join(ranges))
    for i, level in enumerate(sky.levels):
        group = ET.SubElement(parent, "Group", DEF=f"level{i}")
        named: set[str] = set()
        for number in sorted({number for number, _ in level.meshes}):
            switch = ET.SubElement(
                group, "Switch", DEF=_switch(i, number), whichChoice="0"
            )
            for sector in sky.sectors:
                mesh = level.meshes.get((number, sector.name))
                if mesh is None:
                    ET.SubElement(switch, "Group")
                    continue
                name = f"texture{i}_{sector.name}"
                address = None if name in named else level.textures[sector.name]
                _shape(switch, name, mesh, address, clear=True)
                named.add(name)


def _switch(level: int, tile: int) -> str:
    return f"tile{level}_{tile}"


def _shape(
    parent: ET.Element, name: str, mesh: Mesh, address: str | None, *, clear: bool
) -> None:
    """Add a mesh; with the texture of this name, which is defined where it first is."""
    shape = ET.SubElement(parent, "Shape")
    appearance = ET.SubElement(shape, "Appearance")
    # Light is in the texture.
    ET.SubElement(appearance, "UnlitMaterial")
    if address is None:
        ET.SubElement(appearance, "ImageTexture", USE=name)
    else:
        texture = ET.SubElement(
            appearance, "ImageTexture", DEF=name, url=f'"{address}"'
        )
        texture.set("repeatS", "false")
        texture.set("repeatT", "false")
    triangles = ET.SubElement(
        shape,
        "IndexedTriangleSet",
        solid="false",
        index=" ".join(map(str, mesh.corners.reshape(-1).tolist())),
    )
    ET.SubElement(
        triangles, "Coordinate", point=decimals((mesh.place_m @ AXES.T).reshape(-1))
    )
    ET.SubElement(
        triangles,
        "TextureCoordinate",
        point=decimals(mesh.texture.reshape(-1), ".5f"),
    )


def choices(sky: Sky) -> list[dict]:
    """Return what the turning of boards needs to know of each tile: its switch, and
    where its middle is (x and z)."""
    found = []
    for i, level in enumerate(sky.levels):
        for number in sorted({number for number, _ in level.meshes}):
            east, north = level.tiles.middle_m(number)
            found.append(
                {"switch": _switch(i, number), "x": round(east), "z": round(-north)}
            )
    return found


# What a viewer at x, y, z sees of a tile with its middle at x and z: 0 from above, else
# one more than the number of the azimuth, clockwise from north.
CHOICE = """
function choice(x, y, z) {
  if (y > STEEP * Math.sqrt(x * x + z * z)) return 0;
  var turn = Math.atan2(x, -z) / (2 * Math.PI);
  return 1 + ((Math.round(turn * AZIMUTHS) % AZIMUTHS) + AZIMUTHS) % AZIMUTHS;
}
"""


def choice_code(sky: Sky) -> str:
    """Return the function of JavaScript that chooses a sector."""
    steep = np.tan(np.radians(STEEP_DEG))
    return CHOICE.replace("STEEP", f"{steep:.4f}").replace(
        "AZIMUTHS", str(len(sky.sectors) - 1)
    )


def _turning(scene: ET.Element, world: ET.Element, sky: Sky) -> None:
    """Let a script show of each tile the sector that the viewer is in."""
    size = decimal(100 * sky.box.size_m)
    ET.SubElement(world, "ProximitySensor", DEF="viewer", size=f"{size} {size} {size}")
    script = ET.SubElement(scene, "Script", DEF="turn", directOutput="true")
    ET.SubElement(script, "field", accessType="inputOnly", name="place", type="SFVec3f")
    tiles = choices(sky)
    for i in range(len(tiles)):
        ET.SubElement(
            script, "field", accessType="outputOnly", name=f"show{i}", type="SFInt32"
        )
    lines = [
        f"show{i} = choice(eye.x - ({t['x']}), eye.y - {decimal(sky.top_m / 2)}, "
        f"eye.z - ({t['z']}));"
        for i, t in enumerate(tiles)
    ]
    body = "\n  ".join(lines)
    script.text = (
        f"ecmascript:\n{choice_code(sky)}\nfunction place(eye) {{\n  {body}\n}}\n"
    )
    ET.SubElement(
        scene,
        "ROUTE",
        fromNode="viewer",
        fromField="position_changed",
        toNode="turn",
        toField="place",
    )
    for i, tile in enumerate(tiles):
        ET.SubElement(
            scene,
            "ROUTE",
            fromNode="turn",
            fromField=f"show{i}",
            toNode=tile["switch"],
            toField="set_whichChoice",
        )
