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

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from cloudjax import Scene, put


# Of the range between the bounds: what rounding to float32 moves a bound by.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Parameter:
    """One number of a scene that may be fitted.

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
        """The value on the parameter's own scale, where its prior is Gaussian."""
        return jnp.log(value) if self.log else value

    def value(self, z: Float[Array, ""]) -> Float[Array, ""]:
        low, high = self._ends
        middle, slope = self._logistic
        scaled = low + (high - low) * jax.nn.sigmoid(middle + slope * z)
        return jnp.exp(scaled) if self.log else scaled

    def unbounded(self, value: float) -> float:
        """The inverse of `value`."""
        middle, slope = self._logistic
        return (self._logit(value) - middle) / slope

    def surprise(self, value: Float[Array, ""]) -> Float[Array, ""]:
        """Standard deviations of the prior away from its middle."""
        middle = math.log(self.default) if self.log else self.default
        return (self.scaled(value) - middle) / self.spread

    @property
    def _logistic(self) -> tuple[float, float]:
        """Logit of the default, and how much of it a prior's deviation is."""
        low, high = self._ends
        middle = self._logit(self.default)
        share = 1 / (1 + math.exp(-middle))
        return middle, self.spread / ((high - low) * share * (1 - share))

    def _logit(self, value: float) -> float:
        low, high = self._ends
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
    def _ends(self) -> tuple[float, float]:
        if self.log:
            return math.log(self.lower), math.log(self.upper)
        return self.lower, self.upper


def put_all(
    scene: Scene, parameters: Sequence[Parameter], values: Float[Array, " parameters"]
) -> Scene:
    """Return the scene with all of these parameters changed."""
    return put(scene, {p.path: values[i] for i, p in enumerate(parameters)})


def values_of(
    parameters: Sequence[Parameter], z: Float[Array, " parameters"]
) -> Float[Array, " parameters"]:
    return jnp.stack([p.value(z[i]) for i, p in enumerate(parameters)])


def unbounded_of(
    parameters: Sequence[Parameter], values: Mapping[str, float] | None = None
) -> Float[Array, " parameters"]:
    """Starting numbers of a solver; parameters that `values` lacks start as default."""
    values = values or {}
    return jnp.asarray(
        [p.unbounded(values.get(p.name, p.default)) for p in parameters], float
    )


def with_overrides(
    parameters: Sequence[Parameter], overrides: Mapping[str, Mapping]
) -> list[Parameter]:
    """Parameters with defaults, bounds, priors or freedom changed by a user.

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
