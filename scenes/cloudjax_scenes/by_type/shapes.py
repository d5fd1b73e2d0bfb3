"""Shapes in which clouds, and sections of clouds, are placed.

All fill a cell from -1/2 to 1/2 to the east and to the north and from 0 to 1 upwards,
with as many points in each part of the volume as in any other. A radius drawn evenly
would crowd them about the axis, a polar angle drawn evenly about the poles.
"""

import abc
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from jaxtyping import Float


Points = Float[np.ndarray, "points 3"]


class AbstractShape(abc.ABC):
    """A shape holds points evenly within its cell."""

    @property
    def footprint(self) -> float:
        """Give the share of the cell's ground that it is over; of round ones π/4."""
        return np.pi / 4

    @abc.abstractmethod
    def points(self, count: int, rng: np.random.Generator) -> Points:
        """Draw points."""


class Cube(AbstractShape):
    """A `Cube` fills the whole cell."""

    @property
    def footprint(self) -> float:
        """Give 1."""
        return 1.0

    def points(self, count: int, rng: np.random.Generator) -> Points:
        """Draw points."""
        return rng.uniform(size=(count, 3)) - [0.5, 0.5, 0.0]


class Cylinder(AbstractShape):
    """A `Cylinder` stands upright."""

    def points(self, count: int, rng: np.random.Generator) -> Points:
        """Draw points."""
        return _round(np.full(count, 0.5), rng.uniform(size=count), rng)


class Cone(AbstractShape):
    """A `Cone` has its tip at the top."""

    def points(self, count: int, rng: np.random.Generator) -> Points:
        """Draw points."""
        # Of the volume, what is above a height goes with the cube of what is left.
        left = np.cbrt(rng.uniform(size=count))
        return _round(left / 2, 1 - left, rng)


class Sphere(AbstractShape):
    """A `Sphere` is as wide and as high as the cell."""

    def points(self, count: int, rng: np.random.Generator) -> Points:
        """Draw points."""
        return _ball(rng.uniform(-1, 1, count), rng) / 2 + [0, 0, 0.5]


class Dome(AbstractShape):
    """A `Dome` is the upper half of a sphere, with a flat base."""

    def points(self, count: int, rng: np.random.Generator) -> Points:
        """Draw points."""
        return _ball(rng.uniform(0, 1, count), rng) * [0.5, 0.5, 1.0]


def _round(radius, height, rng: np.random.Generator) -> Points:
    """Points in discs of these radii, at these heights."""
    off = radius * np.sqrt(rng.uniform(size=len(radius)))
    turn = rng.uniform(0, 2 * np.pi, len(radius))
    return np.stack([off * np.cos(turn), off * np.sin(turn), height], axis=-1)


def _ball(cosine, rng: np.random.Generator) -> Points:
    """Points in a ball of radius 1, by cosines of their polar angles."""
    far = np.cbrt(rng.uniform(size=len(cosine)))
    turn = rng.uniform(0, 2 * np.pi, len(cosine))
    sine = np.sqrt(1 - cosine**2)
    ahead = np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], axis=-1)
    return far[:, None] * ahead


SHAPES: Mapping[str, AbstractShape] = MappingProxyType(
    {
        "cube": Cube(),
        "cylinder": Cylinder(),
        "cone": Cone(),
        "sphere": Sphere(),
        "dome": Dome(),
    }
)
