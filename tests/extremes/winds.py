"""Air at rest, and a storm."""

import numpy as np

from cloudjax.geometry.geodesy import MEAN_RADIUS_M, ecef
from cloudjax.weather.advection import Wind, displacement_map

from .looks import seen_by
from .rows import row


def _drawn_by(speed_m_s: float):
    """Solid air that turns with the Earth's axis, of a speed at the equator, 48 h."""
    φ, λ = np.linspace(-90, 90, 91), np.arange(0, 360, 2.0)
    eastward = speed_m_s * np.cos(np.radians(φ))[None, :, None] + np.zeros((1, 1, 180))
    wind = Wind(eastward, 0 * eastward, φ, λ, radius_m=MEAN_RADIUS_M)
    return displacement_map(wind, hours=48.0, resolution_deg=2.0)


@row("Winds", "0 m/s")
def calm() -> str:
    moved = np.asarray(_drawn_by(0.0).displacement)
    assert np.abs(moved).max() == 0
    return "Nothing is displaced, exactly."


@row("Winds", "150 m/s for 48 hours", slow=True)
def storm() -> str:
    drawn = _drawn_by(150.0)
    points = ecef(np.zeros(36), np.arange(0, 360, 10.0), np.zeros(36))
    points /= np.linalg.norm(points, axis=-1, keepdims=True)
    angle = 150 * 48 * 3600 / MEAN_RADIUS_M
    turned = np.stack(
        [
            points[:, 0] * np.cos(angle) + points[:, 1] * np.sin(angle),
            points[:, 1] * np.cos(angle) - points[:, 0] * np.sin(angle),
            points[:, 2],
        ],
        axis=-1,
    )
    off_km = np.linalg.norm(drawn.upwind(points) - turned, axis=-1).max() * 6371
    assert off_km < 10
    seen_by(displacements=(drawn, drawn), mask=0.5)
    return (
        f"{angle * 6371:.0f} km round the Earth, {off_km:.1f} km off at a resolution "
        "of 2°; what is drawn by it is finite."
    )
