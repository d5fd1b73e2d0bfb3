"""Shadows, as the command line asks for them."""

from cloudjax import Shadows
from cloudjax_data import DataError


def shadows_of(steps: int, light: str) -> Shadows | None:
    """Shadows of so many steps, of none for 0.

    **Arguments:** `light`: the name of the strategy for sunlight.

    **Raises:** `DataError` for less than no steps, and where the strategy has normals
    of its own.
    """
    if steps < 0:
        raise DataError(f"shadows = {steps} is negative: make it 0 or more steps.")
    if steps and light != "physical":
        raise DataError(
            f"Shadows are for physical light, and this is {light}: leave them out, or "
            "use --light physical."
        )
    return Shadows(steps) if steps else None
