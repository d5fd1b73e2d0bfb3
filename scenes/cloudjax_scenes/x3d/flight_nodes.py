"""The nodes of X3D by which a viewpoint flies."""

import xml.etree.ElementTree as ET

import numpy as np

from cloudjax.geometry.geodesy import east_north_up, geodetic

from .box import Box
from .fields import AXES, GEO_SYSTEM, decimal, decimals, looking
from .flight import Flight


# Of the viewpoint and of its clock, which the page starts.
FLIER, CLOCK = "flier", "flight_clock"
DESCRIPTION = "Flight"


def add_flight(
    scene: ET.Element, flight: Flight, box: Box, *, geographic: bool = False
) -> None:
    """Add a viewpoint that flies once from when it is chosen on.

    **Arguments:** `geographic`: place it on the globe, else in the box.
    """
    when, ahead = flight.looks()
    if geographic:
        places = [
            f"{latitude:.7f} {longitude:.7f} {height:.1f}"
            for latitude, longitude, height in zip(
                flight.latitude_deg, flight.longitude_deg, flight.height_m, strict=True
            )
        ]
        # Of a GeoViewpoint they count in the axes of its own place.
        latitude, longitude, _ = geodetic(flight.at(when))
        turns = [
            looking(east_north_up(float(φ), float(λ)) @ d)
            for φ, λ, d in zip(latitude, longitude, ahead, strict=True)
        ]
        kind, system = "Geo", {"geoSystem": GEO_SYSTEM}
    else:
        places = [decimals(p) for p in box.local_m(flight.position_m) @ AXES.T]
        turns = [looking(d) for d in ahead @ box.axes.T]
        kind, system = "", {}
    ET.SubElement(
        scene,
        f"{kind}Viewpoint",
        {"DEF": FLIER, "description": DESCRIPTION, "position": places[0], **system},
        orientation=turns[0],
    )
    ET.SubElement(
        scene, "TimeSensor", DEF=CLOCK, cycleInterval=decimal(flight.seconds[-1])
    )
    _route(scene, (FLIER, "bindTime"), (CLOCK, "set_startTime"))
    _interpolated(
        scene, f"{kind}PositionInterpolator", "position", flight.share, places, system
    )
    _interpolated(scene, "OrientationInterpolator", "orientation", when, turns, {})


def _interpolated(
    scene: ET.Element, node: str, field: str, key: np.ndarray, values, system
) -> None:
    name = f"flight_{field}"
    ET.SubElement(
        scene,
        node,
        {"DEF": name, "key": decimals(key, ".7f"), "keyValue": " ".join(values)},
        **system,
    )
    value = "geovalue_changed" if node.startswith("Geo") else "value_changed"
    _route(scene, (CLOCK, "fraction_changed"), (name, "set_fraction"))
    _route(scene, (name, value), (FLIER, f"set_{field}"))


def _route(scene: ET.Element, start: tuple[str, str], end: tuple[str, str]) -> None:
    ET.SubElement(
        scene,
        "ROUTE",
        fromNode=start[0],
        fromField=start[1],
        toNode=end[0],
        toField=end[1],
    )
