"""Four devices see what one sees, in a process that is started with so many."""

import os
import subprocess
import sys
from pathlib import Path

import jax
import numpy as np

from cloudjax import look, radiances
from cloudjax.image.devices import spread
from cloudjax.image.render import render
from tests.helpers import (
    emissive_bands,
    fractal_cloud,
    geostationary_rays,
    layer,
    make_scene,
    reflective_bands,
    sun,
)


ROOT = Path(__file__).parents[2]
RAYS = 300
SEE = "import sys; from tests.unit.test_devices import keep; keep(sys.argv[1])"


def seen() -> list[np.ndarray]:
    """An image in several tiles, the last one small, and radiances of one view."""
    scene = make_scene(
        [layer(fractal_cloud(nodes=3), steps=4)],
        reflective_bands(1),
        emissive_bands(13),
    )
    rays, light = geostationary_rays(RAYS), sun(40.0)
    image = render(scene, rays, light, tile=90, with_products=True)
    view = spread(look(scene, rays, light))
    parts = image.radiances, image.clouds, radiances(scene, view)
    return [np.asarray(leaf) for leaf in jax.tree.leaves(parts)]


def keep(path: str) -> None:
    """What the other process does."""
    assert jax.local_device_count() == 4
    np.savez(path, *seen())


def test_four_devices_see_what_one_sees(tmp_path):
    """Tolerance: rounding of float32."""
    flags = os.environ.get("XLA_FLAGS", "")
    flags += " --xla_force_host_platform_device_count=4"
    subprocess.run(
        [sys.executable, "-c", SEE, str(tmp_path / "seen.npz")],
        cwd=ROOT,
        env=os.environ | {"XLA_FLAGS": flags, "JAX_PLATFORMS": "cpu"},
        check=True,
    )
    expected = seen()
    with np.load(tmp_path / "seen.npz") as found:
        assert len(found.files) == len(expected)
        for name, one in zip(found.files, expected, strict=True):
            assert one.shape[-1] == RAYS
            np.testing.assert_allclose(found[name], one, rtol=2e-5, atol=1e-6)
