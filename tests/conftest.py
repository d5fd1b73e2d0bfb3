"""One regime for all tests: where the real files are, and JAX without surprises."""

import os
from pathlib import Path

import jax
import pytest


jax.config.update("jax_numpy_rank_promotion", "raise")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real GOES and GFS files, or a skip where there is none."""
    root = Path(__file__).parents[1]
    folder = Path(os.environ.get("CLOUDJAX_DATA", root.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real files: {folder} is absent (set CLOUDJAX_DATA)")
    return folder
