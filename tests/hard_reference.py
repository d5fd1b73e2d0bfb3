"""The paper's hard level set in plain numpy, float64, one point sample per step.

Independent of the renderer but for the chords and the noise: its own
interpolation, its own positions, geodetic altitudes by pyproj, a threshold without any
width, a sum over steps and the first step in cloud.
"""

from dataclasses import dataclass

import numpy as np
import pyproj

from cloudjax import FractalCloud, Rays
from cloudjax.clouds.ladder import frames
from cloudjax.clouds.noise import bands
from cloudjax.geometry.shells import chords


_CARTESIAN = pyproj.Transformer.from_pipeline("+proj=cart +ellps=GRS80")


@dataclass(frozen=True)
class HardMarch:
    """Per ray: way through cloud, distance of and normal at the first step in cloud."""

    depth_m: np.ndarray
    distance_m: np.ndarray
    normal: np.ndarray
    step_m: np.ndarray


def interpolate(voxels: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Periodic trilinear interpolation as a sum of eight weighted voxels."""
    n = len(voxels)
    x = np.asarray(u, np.float64) * n
    low = np.floor(x).astype(int)
    total = np.zeros(x.shape[:-1])
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, x - low, 1 - (x - low)), axis=-1)
        i, j, k = np.moveaxis((low + corner) % n, -1, 0)
        total += weight * voxels[i, j, k]
    return total


def cloud_function(cloud: FractalCloud, position_m: np.ndarray) -> np.ndarray:
    """Eq. (1) at ECEF positions, without mask and wind."""
    f = {k: np.asarray(v, np.float64) for k, v in vars(cloud.function).items()}
    x, y, z = position_m.reshape(-1, 3).T
    _, _, altitude = _CARTESIAN.transform(x, y, z, direction="INVERSE")
    z = np.asarray(altitude).reshape(position_m.shape[:-1])
    value = -f["threshold"] * np.ones_like(z)
    for end in ((f["base_m"] - z), (z - f["top_m"])):
        value -= f["barrier_strength"] * np.exp(end / f["barrier_scale_m"])
    return value + fractal_at(cloud, position_m)


def fractal_at(cloud: FractalCloud, position_m: np.ndarray) -> np.ndarray:
    """The sum of all rungs at ECEF positions, in still air."""
    f = {k: np.asarray(v, np.float64) for k, v in vars(cloud.function).items()}
    value = np.zeros(position_m.shape[:-1])
    for i, rung in enumerate(cloud.rungs):
        persistence, octaves = f["persistences"][rung.ladder], rung.octave
        every = np.array(cloud.ladders[rung.ladder].octaves)
        share = persistence**octaves / np.linalg.norm(persistence**every)
        amplitude = f["gains"][rung.step] * f["weights"][rung.ladder] * share
        frame, shift = (
            np.float64(part[i]) for part in frames(cloud.ladders, cloud.seed)
        )
        voxels = bands(rung.noise)[rung.band].voxels.astype(float)
        value += amplitude * interpolate(voxels, position_m @ frame.T + shift)
    return value


def _normal(cloud, position_m, step_m=0.01):
    """Against the gradient of the cloud function, by central differences."""
    columns = [
        cloud_function(cloud, position_m - step)
        - cloud_function(cloud, position_m + step)
        for step in step_m * np.eye(3)
    ]
    outward = np.stack(columns, axis=-1)
    return outward / np.linalg.norm(outward, axis=-1, keepdims=True)


def march(cloud: FractalCloud, rays: Rays, steps: int) -> HardMarch:
    """March all rays; rays that meet no cloud have depth 0 and the rest undefined."""
    chord = chords(rays, cloud.shell)
    along = chord.length_m[:, None] * (np.arange(steps) + 0.5) / steps
    distance = chord.entry_m[:, None] + along
    place = rays.origin_m[:, None] + distance[..., None] * rays.direction[:, None]
    inside = cloud_function(cloud, place) > 0
    first = inside.argmax(-1)[:, None]
    surface = np.take_along_axis(place, first[..., None], axis=1)[:, 0]
    step = chord.length_m / steps
    return HardMarch(
        inside.sum(-1) * step,
        np.take_along_axis(along, first, axis=1)[:, 0],
        _normal(cloud, surface),
        step,
    )
