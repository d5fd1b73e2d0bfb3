"""Waves and pixels of any size, images of any shape."""

from dataclasses import replace

import jax
import numpy as np

from cloudjax import PlaneParallel, look, radiances, render
from tests.helpers import sun

from .looks import DECK, SIMPLE, near, seen_by
from .rows import row


@row("Textures", "Wavelengths of 100 m and 5000 km", slow=True)
def waves() -> str:
    found = []
    for longest in (200.0, 5e6):
        kind = replace(SIMPLE, waves_m=(longest, longest / 2))
        found.append(seen_by(kind=kind, mask=0.5))
    spread = [seen.cover.std() for seen in found]
    # Pixels of 2 km see nothing of the one, and hardly a change within a few in the
    # other. Measured: 0.003 and 0.13.
    assert spread[0] < 0.006
    assert spread[1] < 0.25
    return (
        "Finite with their derivatives; cover within 2° varies by "
        f"{spread[0]:.2f} and {spread[1]:.2f}."
    )


@row("Pixels", "Of 1 m and of 100 km")
def pixel_sizes() -> str:
    spread = []
    for metres in (1.0, 1e5):
        seen = seen_by(near(pixel_rad=metres / 3.6e7), mask=0.0)
        spread.append(seen.cover.std())
    assert spread[1] < spread[0]
    return (
        f"Cover varies by {spread[0]:.2f} from pixel to pixel and by {spread[1]:.2f}: "
        "large pixels are averages."
    )


@row("Pixels", "One ray; images of prime size; tiles of any size", slow=True)
def shapes() -> str:
    scene, rays = SIMPLE.scene(SIMPLE.vector(**DECK), PlaneParallel.load()), near()
    whole = radiances(scene, look(scene, rays[:37], sun(40.0)))
    image = render(scene, rays[:37], sun(40.0), tile=13).radiances
    one = radiances(scene, look(scene, rays[5:6], sun(40.0)))
    difference = 0.0
    for all_of_it, tiled, alone in zip(
        *map(jax.tree.leaves, (whole, image, one)), strict=True
    ):
        difference = max(difference, float(np.abs(tiled / all_of_it - 1).max()))
        difference = max(
            difference, float(np.abs(alone[:, 0] / all_of_it[:, 5] - 1).max())
        )
    assert difference < 2e-5
    return (
        f"The same radiances but for {difference:.0e} of them (37 rays, tiles of 13)."
    )


@row("Pixels", "One band", slow=True)
def one_band() -> str:
    seen, both = seen_by(kind=replace(SIMPLE, thermal=())), seen_by()
    np.testing.assert_allclose(seen.radiance[:, 0], both.radiance[:, 0], rtol=1e-4)
    return "Sunlight alone is what it is beside emission."
