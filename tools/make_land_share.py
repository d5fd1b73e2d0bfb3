"""Make scenes/cloudjax_scenes/land_share.npz: the share of land in 0.1 degree cells.

Needs the package `global-land-mask` (MIT), which holds which of the 30 arc second cells
of GLOBE (GLOBE Task Team 1999, NOAA, public domain) are sea, and 2 GB of memory.
"""

import sys
from pathlib import Path

import numpy as np
from global_land_mask import globe  # pyright: ignore[reportMissingImports]


CELLS = 12
LEVELS = 15


def main(path: Path) -> None:
    sea = globe._mask
    rows, columns = (size // CELLS for size in sea.shape)
    share = np.empty((rows, columns))
    for row in range(rows):
        block = sea[row * CELLS : (row + 1) * CELLS]
        share[row] = 1 - block.reshape(CELLS, columns, CELLS).mean(axis=(0, 2))
    # From the south, in 16 levels, two to a byte.
    level = np.round(share[::-1] * LEVELS).astype(np.uint8)
    np.savez_compressed(path, share=level[:, ::2] << 4 | level[:, 1::2])
    print(f"{path}: {path.stat().st_size} bytes, {share.mean():.4f} of cells is land")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
