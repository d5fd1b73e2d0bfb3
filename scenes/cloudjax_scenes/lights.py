"""Strategies for light, by name."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax.numpy as jnp

from cloudjax import (
    AbstractReflection,
    Band,
    CloudClass,
    EmittingSlabs,
    PlaneParallel,
    Scene,
    Shadows,
    Slabs,
    TwoFlux,
    imagery_classes,
)
from cloudjax_data import DataError


@dataclass(frozen=True)
class Light:
    """A `Light` is a strategy for light, and what extinction means to it.

    **Fields:**

    - `name`: of the strategy.
    - `share`: of the physical extinction that it calls extinction; absorption in the
      infrared is the physical one.
    - `reflection`: makes the strategy for sunlight.
    - `emission`: makes the strategy for thermal radiation; None where cloud only
      absorbs.
    - `air`: whether the air above the clouds is computed in scenes from imagery; else a
      path and a gain of each band stand for it.
    """

    name: str
    share: float
    reflection: Callable[[], AbstractReflection]
    emission: Callable[[], EmittingSlabs] | None = None
    air: bool = False

    def emission_in(self, thermal: Sequence[Band]) -> EmittingSlabs | None:
        """Make the strategy for thermal radiation.

        None where no band emits, or where cloud only absorbs.
        """
        return self.emission() if self.emission and thermal else None

    def shadows(self, steps: int) -> Shadows | None:
        """Make shadows of so many steps, none for 0.

        **Raises:** `DataError` for less than no steps, and where the strategy has
        normals of its own.
        """
        if steps < 0:
            raise DataError(f"shadows = {steps} is negative: make it 0 or more steps.")
        if steps and self is not PHYSICAL:
            raise DataError(
                f"Shadows are for physical light, and this is {self.name}: leave them "
                "out, or use --light physical."
            )
        return Shadows(steps) if steps else None

    def imagery_classes(self) -> dict[str, CloudClass]:
        """Return the classes that scenes from imagery have where nobody says which."""
        return imagery_classes(paper_light=self is PAPER)


# All extinction sends light back, which is (1 - g)/2 of it for g = 0.85
# (docs/theory/paper.md).
PAPER = Light("paper", (1 - 0.85) / 2, lambda: TwoFlux(indirect=jnp.asarray(0.3)))
PHYSICAL = Light(
    "physical",
    1.0,
    lambda: Slabs(PlaneParallel.load()),
    lambda: EmittingSlabs(PlaneParallel.load()),
    air=True,
)
LIGHTS = {light.name: light for light in (PAPER, PHYSICAL)}


def light_named(name: str) -> Light:
    """Return the strategy of this name.

    **Raises:** `DataError` if there is none.
    """
    if name not in LIGHTS:
        raise DataError(f"There is no light {name!r}: make it {' or '.join(LIGHTS)}.")
    return LIGHTS[name]


def light_of(scene: Scene) -> Light:
    """Return the strategy that a scene has been built for."""
    return PAPER if isinstance(scene.reflection, TwoFlux) else PHYSICAL
