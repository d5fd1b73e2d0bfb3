"""The X3D document of a volume: voxels in place of boards."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable

from .document import Sky, stage, whole_file
from .fields import decimal, decimals
from .voxels import Voxels


_MAP = "white"


def volume_document(sky: Sky, voxels: Voxels) -> bytes:
    """Make a whole file, X3D 4.0 in XML: `VolumeData` in metres about the box's centre.

    Cloud is white: a voxel's number is its opacity alone.
    """
    scene, world = stage(sky)
    for info in scene.iter("NavigationInfo"):
        # X_ITE's shader of volumes does not compile where there is no light at all.
        info.set("headlight", "true")
    east, north, up = voxels.size_m
    place = ET.SubElement(
        world,
        "Transform",
        translation=decimals([0.0, (voxels.low_m + voxels.high_m) / 2, 0.0]),
    )
    volume = ET.SubElement(
        place, "VolumeData", DEF="volume", dimensions=decimals([east, up, north])
    )
    _whiten(scene, ET.SubElement(volume, "OpacityMapVolumeStyle"))
    opacity = voxels.opacity
    levels, rows, columns = opacity.shape
    # Rows of X3D go upwards, and its slices to the south as our rows do.
    ET.SubElement(
        volume,
        "PixelTexture3D",
        containerField="voxels",
        repeatS="false",
        repeatT="false",
        repeatR="false",
        image=_image(
            (1, columns, levels, rows), opacity.transpose(1, 0, 2).reshape(-1).tolist()
        ),
    )
    about = {**sky.about, "slices": f"{decimal(voxels.slice_m)} m from each other"}
    return whole_file(scene, about, "Full")


def _whiten(scene: ET.Element, style: ET.Element) -> None:
    """Map voxels to white of their opacity; the usual map makes them as dark as thin.

    The schema lets no texture be the map of a style, but a prototype of one.
    """
    prototype = ET.Element("ProtoDeclare", name=_MAP)
    ET.SubElement(
        ET.SubElement(prototype, "ProtoBody"),
        "PixelTexture",
        repeatS="false",
        repeatT="false",
        image=_image((256, 1, 2), (255 * 256 + i for i in range(256))),
    )
    scene.insert(0, prototype)
    ET.SubElement(style, "ProtoInstance", name=_MAP, containerField="transferFunction")


def _image(header: tuple[int, ...], values: Iterable[int]) -> str:
    """Write an image in decimal numbers, for the schema refuses others."""
    return " ".join(map(str, [*header, *values]))
