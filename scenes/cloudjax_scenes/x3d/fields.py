"""Values as fields of X3D are written, and the axes of its scenes."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float


GEO_SYSTEM = '"GD" "WE"'
# X3D has y upwards and z to the viewer: rows are its axes, as east, north and up.
AXES = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])


def decimal(value: float) -> str:
    """Write a number."""
    return f"{value:.6g}"


def decimals(values: np.ndarray | Sequence[float], form: str = ".1f") -> str:
    """Write numbers."""
    return " ".join(format(float(v), form) for v in values)


def rotation(azimuth_deg: float, elevation_deg: float) -> str:
    """Write axis and angle of a viewer at an azimuth and elevation, who looks back."""
    # First the heading about y, then the pitch: as quaternions.
    h, p = np.radians([180 - azimuth_deg, -elevation_deg]) / 2
    w, x = np.cos(h) * np.cos(p), np.cos(h) * np.sin(p)
    y, z = np.sin(h) * np.cos(p), -np.sin(h) * np.sin(p)
    size = np.sqrt(x * x + y * y + z * z)
    if size < 1e-9:
        return "0 1 0 0"
    axis = np.array([x, y, z]) / size
    return f"{decimals(axis, '.6f')} {2 * np.arctan2(size, w):.6f}"


def looking(ahead: Float[np.ndarray, "3"]) -> str:
    """Write axis and angle of a viewer who looks to the east, north and up."""
    east, north, up = -ahead / np.linalg.norm(ahead)
    level = np.hypot(east, north)
    azimuth = np.degrees(np.arctan2(east, north)) if level > 1e-6 else 180.0
    return rotation(float(azimuth), float(np.degrees(np.arcsin(np.clip(up, -1, 1)))))
