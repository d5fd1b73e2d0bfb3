"""Clouds that peers can read: ladders whose rungs are not turned.

So all rungs of a ladder repeat after the period of its longest, and one texture of
points holds their sum, as the paper's textures do.
"""

import dataclasses
import math

import jax.numpy as jnp
import numpy as np

from cloudjax import FractalCloud, Ladder
from cloudjax.clouds.ladder import amplitudes
from cloudjax.clouds.noise import VOXELS, WAVES, bands


class StraightCloud(FractalCloud):
    """A cloud whose rungs are neither turned nor shifted."""

    @property
    def frames(self):
        periods = np.array([rung.period_m for rung in self.rungs])
        turned = np.eye(3) / periods[:, None, None]
        return turned.astype(np.float32), np.zeros((len(periods), 3), np.float32)


FIELDS = tuple(FractalCloud.__dataclass_fields__)


def straight(cloud: FractalCloud, voxels: int) -> StraightCloud:
    """Leave of each ladder what so many voxels per period hold to the digit."""
    octaves = round(math.log2(voxels / VOXELS))
    if octaves < 0:
        raise ValueError(f"{voxels} voxels hold no noise: give {VOXELS} or more.")
    ladders = tuple(
        Ladder(
            one.noise, one.longest_m, max(one.shortest_m, one.longest_m / 2**octaves)
        )
        for one in cloud.ladders
    )
    steps = sum(len(one.octaves) for one in ladders)
    function = dataclasses.replace(cloud.function, gains=jnp.ones(steps))
    fields = {name: getattr(cloud, name) for name in FIELDS}
    return StraightCloud(**fields | {"ladders": ladders, "function": function})


def textures(cloud: StraightCloud, voxels: int) -> tuple[np.ndarray, ...]:
    """The sum of the rungs of each ladder, of weight 1, at the nodes of a texture."""
    f = cloud.function
    ones = jnp.ones(len(cloud.ladders))
    shares = amplitudes(cloud.ladders, ones, f.persistences, f.gains)
    made = [np.zeros((voxels,) * 3, np.float32) for _ in cloud.ladders]
    for rung, share in zip(cloud.rungs, shares, strict=True):
        hats = _hats(2**rung.octave * np.arange(voxels) / voxels)
        field = bands(rung.noise)[rung.band].voxels
        for _ in range(3):
            field = np.moveaxis(np.tensordot(hats, field, axes=(1, 0)), 0, -1)
        made[rung.ladder] += float(share) * field
    return tuple(made)


def periods_m(cloud: FractalCloud) -> tuple[float, ...]:
    """Of the texture of each ladder."""
    return tuple(WAVES * ladder.longest_m for ladder in cloud.ladders)


def _hats(u: np.ndarray) -> np.ndarray:
    """Weights of the nodes at positions in periods, [positions nodes]."""
    scaled = u * VOXELS
    low = np.floor(scaled).astype(int)
    weights = np.zeros((len(u), VOXELS), np.float32)
    rows = np.arange(len(u))
    np.add.at(weights, (rows, low % VOXELS), 1 - (scaled - low))
    np.add.at(weights, (rows, (low + 1) % VOXELS), scaled - low)
    return weights
