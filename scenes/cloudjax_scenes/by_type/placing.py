"""Clouds by type become particles: drawn in their shapes, section by section."""

import numpy as np
from jaxtyping import Float

from cloudjax.geometry.map_projections import LocalPlane
from cloudjax.particles.cloud_particles import CloudParticles
from cloudjax_data import DataError

from .cloud_types import CloudType
from .shapes import SHAPES
from .sky_file import CloudGroup, TypedSky


# Of them the renderer makes columns in some seconds.
_MOST = 300_000

Points = Float[np.ndarray, "kernels 3"]


def particles_of(sky: TypedSky, origin_deg: tuple[float, float]) -> CloudParticles:
    """Place the particles of a sky about an origin, latitude and longitude.

    The extinction areas of each cloud add up to its optical depth times the ground
    below its shape.

    **Raises:** `DataError` for more particles than can be rendered.
    """
    count = sum(g.quantity * g.type.sections * g.type.kernels for g in sky.groups)
    if count > _MOST:
        raise DataError(
            f"{sky.path} asks for {count} kernels, more than {_MOST}: give a smaller "
            "quantity, or fewer and larger kernels."
        )
    rng = np.random.default_rng(sky.seed)
    parts = [_clouds(group, rng) for group in sky.groups]
    place, area, radius, ice = (
        np.concatenate(values) for values in zip(*parts, strict=True)
    )
    latitude, longitude = LocalPlane(*origin_deg).places(place[:, 0], place[:, 1])
    return CloudParticles(
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_m=place[:, 2] + sky.ground_m,
        radius_m=radius,
        extinction_area_m2=area,
        velocity_m_s=np.zeros((count, 3)),
        birth_s=np.full(count, -np.inf),
        death_s=np.full(count, np.inf),
        ice_share=ice,
    )


def _clouds(group: CloudGroup, rng: np.random.Generator):
    """Places of the kernels of a group, their areas, radii and shares of ice."""
    kind, shape = group.type, SHAPES[group.type.shape]
    middle = rng.uniform(-0.5, 0.5, (group.quantity, 2)) * group.within_m
    middle += [group.east_m, group.north_m]
    sizes = 1 + kind.vary * rng.uniform(-1, 1, group.quantity)
    kernels = kind.sections * kind.kernels
    places, areas = [], []
    for at, size in zip(middle, sizes, strict=True):
        place = _kernels(kind, size, group.along_deg, rng)
        place[:, :2] += at
        places.append(place)
        ground = shape.footprint * kind.stretch * (kind.width_m * size) ** 2
        areas.append(np.full(kernels, kind.optical_depth * ground / kernels))
    count = group.quantity * kernels
    return (
        np.concatenate(places),
        np.concatenate(areas),
        np.full(count, kind.kernel_m),
        np.full(count, kind.ice_share),
    )


def _kernels(
    kind: CloudType, size: float, along_deg: float, rng: np.random.Generator
) -> Points:
    """Kernels of one cloud about its middle: within its shape as wholes."""
    shape, part = SHAPES[kind.shape], kind.section_share
    section = np.repeat(shape.points(kind.sections, rng), kind.kernels, axis=0)
    within = shape.points(len(section), rng)
    unit = (1 - part) * section + part * within
    width, height = kind.width_m * size, (kind.top_m - kind.base_m) * size
    extent = np.array([width, width * kind.stretch, height])
    # Larger kernels than the cloud stand in its middle.
    room = np.maximum(extent - 2 * kind.kernel_m, 0)
    across, along = (unit[:, :2] * room[:2]).T
    low = kind.base_m + (height - room[2]) / 2
    turn = np.radians(along_deg)
    east = along * np.sin(turn) - across * np.cos(turn)
    north = along * np.cos(turn) + across * np.sin(turn)
    return np.stack([east, north, low + unit[:, 2] * room[2]], axis=-1)
