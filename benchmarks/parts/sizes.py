"""What all parts are given: how large their work is, and what is at hand."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Sizes:
    """The sizes of a whole run, unless said otherwise.

    **Fields:**

    - `disc`: pixels, voxels and steps of the only full disc; None for Table 3.
    - `presets`: steps and nodes of cloudjax.
    - `truth_pixels`, `truth_parts`, `truth_steps`: a random choice of pixels, hard rays
      per pixel and axis, steps.
    - `mesoscale_voxels`: per axis; `mesoscale_steps`, `mesoscale_presets`: of the peers
      and of cloudjax.
    - `map_degrees`, `map_steps`: of the displacement map.
    - `fit_rays`, `fit_evaluations`: of a fit, and how often scipy's may look.
    - `scan_pixels`, `scan_steps`, `scan_layers`, `scan_bands`: the first of each is
      what the other scans have.
    - `repeats`: of what is timed.
    """

    disc: tuple[int, int, int] | None = None
    presets: tuple[tuple[int, int], ...] = (
        (2, 1),
        (3, 3),
        (4, 3),
        (6, 3),
        (12, 3),
        (25, 5),
    )
    truth_pixels: int = 2000
    truth_parts: int = 8
    truth_steps: int = 200
    mesoscale_voxels: int = 128
    mesoscale_steps: int = 24
    mesoscale_presets: tuple[tuple[int, int], ...] = ((6, 3), (12, 3), (24, 5))
    map_degrees: float = 0.25
    map_steps: int = 40
    fit_rays: int = 8192
    fit_evaluations: int = 1000
    scan_pixels: tuple[int, ...] = (250, 500, 1000, 1500)
    scan_steps: tuple[int, ...] = (6, 12, 24, 48)
    scan_layers: tuple[int, ...] = (1, 2, 3, 4)
    scan_bands: tuple[int, ...] = (1, 2, 4, 8)
    scan_voxels: int = 128
    repeats: int = 3


QUICK = Sizes(
    disc=(24, 64, 8),
    presets=((6, 3),),
    truth_pixels=200,
    truth_parts=2,
    truth_steps=16,
    mesoscale_voxels=64,
    mesoscale_steps=6,
    mesoscale_presets=((6, 3),),
    map_degrees=5.0,
    map_steps=8,
    fit_rays=256,
    fit_evaluations=20,
    scan_pixels=(16, 24),
    scan_steps=(4, 8),
    scan_layers=(1, 2),
    scan_bands=(1, 2),
    scan_voxels=64,
    repeats=1,
)


@dataclass(frozen=True, eq=False)
class Context:
    """A run of the benchmark.

    **Fields:**

    - `peers`: modules of those that can run here.
    - `fraction`: of low cloud over the globe, [lat lon].
    - `log`: says what is going on.
    """

    sizes: Sizes
    peers: tuple[str, ...]
    fraction: np.ndarray
    log: Callable[[str], None]
