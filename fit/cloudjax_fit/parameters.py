"""Fitted parameters: where they sit in a scene, their bounds and their priors.

The solver works on unbounded numbers z; each parameter maps its own onto the open
interval between its bounds by a logistic curve, on a logarithmic scale where it has
one. Its prior is a Gaussian on the parameter or on its logarithm. z counts standard
deviations of the prior away from the default, to first order, so that the damping of
Levenberg-Marquardt treats all parameters alike.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from cloudjax import Scene, put


# Of the range between the bounds: what rounding to float32 moves a bound by.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Parameter:
    """A `Parameter` is one number of a scene that may be fitted.

    **Fields:**

    - `name`: such as "low_stratus.threshold"; `unit`.
    - `path`: where it sits in the scene, see `cloudjax.parameters`.
    - `default`: where fits start and the middle of the prior.
    - `lower`, `upper`: bounds.
    - `spread`: standard deviation of the prior, a factor's logarithm where `log`.
    - `log`: whether scale and prior are logarithmic.
    - `free`: whether a fit may move it.
    """

    name: str
    path: str
    default: float
    lower: float
    upper: float
    spread: float
    unit: str = ""
    log: bool = False
    free: bool = True

    def __post_init__(self):
        if not self.allows(self.default):
            raise ValueError(self._out_of_bounds(self.default))

    def allows(self, value: float) -> bool:
        """Tell whether a value is within the bounds, but for rounding; NaN is not."""
        slack = _ROUNDING * (self.upper - self.lower)
        return self.lower - slack <= value <= self.upper + slack

    def scaled(self, value):
        """Return a value on the parameter's own scale, where its prior is Gaussian."""
        return jnp.log(value) if self.log else value

    def unbounded(self, value: float) -> float:
        """Invert `value`."""
        middle, slope = self.logistic
        return (self._logit(value) - middle) / slope

    @property
    def centre(self) -> float:
        """Give the middle of the prior, on the parameter's own scale."""
        return math.log(self.default) if self.log else self.default

    @property
    def logistic(self) -> tuple[float, float]:
        """Give the logit of the default, and how much of it a prior's deviation is."""
        low, high = self.ends
        middle = self._logit(self.default)
        share = 1 / (1 + math.exp(-middle))
        return middle, self.spread / ((high - low) * share * (1 - share))

    def _logit(self, value: float) -> float:
        low, high = self.ends
        share = ((math.log(value) if self.log else value) - low) / (high - low)
        if not 0 < share < 1:
            raise ValueError(self._out_of_bounds(value))
        return math.log(share / (1 - share))

    def _out_of_bounds(self, value: float) -> str:
        return (
            f"{self.name} = {value:g} is not between its bounds {self.lower:g} and "
            f"{self.upper:g}"
        )

    @property
    def ends(self) -> tuple[float, float]:
        """Give the bounds on the parameter's own scale."""
        if self.log:
            return math.log(self.lower), math.log(self.upper)
        return self.lower, self.upper


class Parameters(eqx.Module):
    """`Parameters` of a fit are arrays: scenes of one structure share compiled
    functions.

    **Fields:**

    - `paths`: where they sit in the scene.
    - `low`, `high`: bounds, on each parameter's own scale, and `log`: whether that is
      logarithmic.
    - `middle`, `slope`: of the logistic curve from z to the part of the way between
      the bounds.
    - `centre`, `spread`: of the priors, on that scale.
    """

    paths: tuple[str, ...] = eqx.field(static=True)
    low: Float[Array, " parameters"]
    high: Float[Array, " parameters"]
    log: Bool[Array, " parameters"]
    middle: Float[Array, " parameters"]
    slope: Float[Array, " parameters"]
    centre: Float[Array, " parameters"]
    spread: Float[Array, " parameters"]

    @classmethod
    def of(cls, parameters: Sequence[Parameter]) -> "Parameters":
        """Collect the numbers of parameters."""

        def column(numbers) -> Array:
            return jnp.asarray(list(numbers), float)

        return cls(
            paths=tuple(p.path for p in parameters),
            low=column(p.ends[0] for p in parameters),
            high=column(p.ends[1] for p in parameters),
            log=jnp.asarray([p.log for p in parameters], bool),
            middle=column(p.logistic[0] for p in parameters),
            slope=column(p.logistic[1] for p in parameters),
            centre=column(p.centre for p in parameters),
            spread=column(p.spread for p in parameters),
        )

    def __len__(self) -> int:
        return len(self.paths)

    def values(self, z: Float[Array, " parameters"]) -> Float[Array, " parameters"]:
        """Return the parameters in their own units."""
        scaled = self.scaled(z)
        # The inner choice keeps what is not logarithmic from overflowing.
        return jnp.where(self.log, jnp.exp(jnp.where(self.log, scaled, 0.0)), scaled)

    def scaled(self, z: Float[Array, " parameters"]) -> Float[Array, " parameters"]:
        """Return the parameters on their own scales, where priors are Gaussian."""
        share = jax.nn.sigmoid(self.middle + self.slope * z)
        return self.low + (self.high - self.low) * share

    def surprise(self, z: Float[Array, " parameters"]) -> Float[Array, " parameters"]:
        """Return standard deviations of the priors away from their middles."""
        return (self.scaled(z) - self.centre) / self.spread

    def put(self, scene: Scene, values: Float[Array, " parameters"]) -> Scene:
        """Return the scene with all of them changed."""
        return put(scene, {path: values[i] for i, path in enumerate(self.paths)})


def put_all(
    scene: Scene, parameters: Sequence[Parameter], values: Float[Array, " parameters"]
) -> Scene:
    """Return the scene with all of these parameters changed."""
    return put(scene, {p.path: values[i] for i, p in enumerate(parameters)})


def values_of(
    parameters: Sequence[Parameter], z: Float[Array, " parameters"]
) -> Float[Array, " parameters"]:
    """Return the values, in their own units, of a solver's numbers."""
    return Parameters.of(parameters).values(z)


def unbounded_of(
    parameters: Sequence[Parameter], values: Mapping[str, float] | None = None
) -> Float[Array, " parameters"]:
    """Return starting numbers of a solver; parameters that `values` lacks start as
    default.
    """
    values = values or {}
    return jnp.asarray(
        [p.unbounded(values.get(p.name, p.default)) for p in parameters], float
    )


def with_overrides(
    parameters: Sequence[Parameter], overrides: Mapping[str, Mapping]
) -> list[Parameter]:
    """Return parameters with defaults, bounds, priors or freedom changed by a user.

    **Raises:** `ValueError` for a parameter or a key that does not exist.
    """
    names = [p.name for p in parameters]
    allowed = {"default", "lower", "upper", "spread", "free"}
    for name, changes in overrides.items():
        if name not in names:
            raise ValueError(f"unknown parameter {name!r}: there are {names}")
        unknown = sorted(set(changes) - allowed)
        if unknown:
            raise ValueError(
                f"unknown key {unknown[0]!r} of {name!r}: there are {sorted(allowed)}"
            )
    return [replace(p, **overrides.get(p.name, {})) for p in parameters]
