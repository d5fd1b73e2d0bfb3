"""Ordinary differential equations are integrated in explicit steps of equal length."""

import abc
from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array


Rate = Callable[[Array, Array], Array]


class AbstractScheme(eqx.Module):
    """A scheme takes one explicit step of dy/dt = rate(y, t), of global error O(step **
    order).
    """

    order: ClassVar[int]

    @abc.abstractmethod
    def __call__(self, rate: Rate, y: Array, t: Array, step: Array) -> Array:
        """Return y at t + step."""


class Euler(AbstractScheme):
    """Forward Euler, first order: for comparison."""

    order: ClassVar[int] = 1

    def __call__(self, rate: Rate, y: Array, t: Array, step: Array) -> Array:
        """y at t + step."""
        return y + step * rate(y, t)


class Heun(AbstractScheme):
    """The explicit trapezoidal rule, second order: half the price of `RungeKutta4`."""

    order: ClassVar[int] = 2

    def __call__(self, rate: Rate, y: Array, t: Array, step: Array) -> Array:
        """y at t + step."""
        k1 = rate(y, t)
        k2 = rate(y + step * k1, t + step)
        return y + step / 2 * (k1 + k2)


class RungeKutta4(AbstractScheme):
    """This is the classical fourth-order method."""

    order: ClassVar[int] = 4

    def __call__(self, rate: Rate, y: Array, t: Array, step: Array) -> Array:
        """Return y at t + step."""
        k1 = rate(y, t)
        k2 = rate(y + step / 2 * k1, t + step / 2)
        k3 = rate(y + step / 2 * k2, t + step / 2)
        k4 = rate(y + step * k3, t + step)
        return y + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
