"""Ordinary differential equations are integrated in explicit steps of equal length."""

import abc
from collections.abc import Callable

import equinox as eqx
from jaxtyping import Array


Rate = Callable[[Array, Array], Array]


class AbstractScheme(eqx.Module):
    """A scheme takes one explicit step of dy/dt = rate(y, t)."""

    @abc.abstractmethod
    def __call__(self, rate: Rate, y: Array, t: Array, step: Array) -> Array:
        """Return y at t + step."""


class RungeKutta4(AbstractScheme):
    """This is the classical fourth-order method."""

    def __call__(self, rate: Rate, y: Array, t: Array, step: Array) -> Array:
        """Return y at t + step."""
        k1 = rate(y, t)
        k2 = rate(y + step / 2 * k1, t + step / 2)
        k3 = rate(y + step / 2 * k2, t + step / 2)
        k4 = rate(y + step * k3, t + step)
        return y + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
