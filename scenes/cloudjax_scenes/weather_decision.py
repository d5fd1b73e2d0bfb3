"""Decisions on where clouds are in an analysis, by name.

A decision is a strategy: from analyses and classes it makes the fraction of the sky
that each class covers, and the mask under which it does.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from cloudjax import (
    AbstractMask,
    CloudClass,
    ColumnCover,
    Conditions,
    CoverMask,
    MaskGrid,
    cloud_classes,
    cloud_fraction,
    cover_grid,
    weather_classes,
)
from cloudjax.weather.evidence import LAYERS, Evidence, left_by, shared
from cloudjax.weather.masks import suitability
from cloudjax_data import DataError, WeatherCube

from .weather_evidence import SkyEvidence


Fractions = dict[str, Float[np.ndarray, "lat lon"]]
MaskOf = Callable[[AbstractMask], AbstractMask]
Axes = tuple[Float[np.ndarray, " lat"], Float[np.ndarray, " lon"]]
# Where a class does not say its layer: its middle is below 642 or 350 hPa of the
# standard atmosphere.
_LOW_BELOW_M, _MIDDLE_BELOW_M = 3.6e3, 8.1e3
# A class that would cover less is left out there, and is not marched.
_LEAST_COVER = 1e-3


_LABELS = {
    "boundary_layer_share": "boundary layer",
    "inversion_k": "inversion",
    "tropopause_m": "tropopause",
    "ascent_pa_s": "ascent",
    "deep_convection": "deep convection",
}


class CoverDecision(ABC):
    """A decision on where clouds are."""

    name: str

    @abstractmethod
    def classes(self) -> dict[str, CloudClass]:
        """Give the classes of cloud that it is meant for."""

    @abstractmethod
    def fractions(
        self,
        cube: WeatherCube,
        classes: Mapping[str, CloudClass],
        *,
        omega_sign: float = -1.0,
    ) -> Fractions:
        """Find the fraction of the sky that each class covers in an analysis, NaN
        under ground.
        """

    @abstractmethod
    def held(self, fraction: Float[np.ndarray, "lat lon"], axes: Axes) -> AbstractMask:
        """Hold a fraction on latitudes and longitudes, as that which is linear between
        places and times.
        """

    @abstractmethod
    def mask(self, one: CloudClass, steps: int) -> MaskOf:
        """Say how the mask of a class, for a march of so many steps, follows from what
        is held.
        """

    @abstractmethod
    def words(self, cube: WeatherCube) -> list[tuple[str, str]]:
        """Say what it takes from an analysis, as labels and sentences."""


@dataclass(frozen=True)
class Table1(CoverDecision):
    """`Table1` is the decision of Schinder et al. (2024), Table 1, with soft edges."""

    name = "table1"

    def classes(self) -> dict[str, CloudClass]:
        """Give its four classes."""
        return cloud_classes()

    def fractions(self, cube, classes, *, omega_sign=-1.0) -> Fractions:
        """Decide by humidity, temperature and vertical motion at one altitude."""
        found = {}
        for name, one in classes.items():
            level = cube.at_altitude(float(one.conditions.sampling_altitude_m))
            found[name] = fractions_at(level, one.conditions, omega_sign)
        return found

    def held(self, fraction, axes) -> AbstractMask:
        """Hold the probit of the fraction."""
        return MaskGrid.from_fraction(fraction, *axes)

    def mask(self, one, steps) -> MaskOf:
        """Take the probit."""
        return lambda held: held

    def words(self, cube) -> list[tuple[str, str]]:
        """Say what it takes."""
        return [
            (
                "clouds",
                "by Table 1: humidity, temperature and vertical motion at the altitude "
                "of each class",
            )
        ]


@dataclass(frozen=True)
class AllEvidence(CoverDecision):
    """`AllEvidence` is the decision that takes all that an analysis tells of clouds.

    Classes share the cover of their layer as their conditions suit the place
    (`cloudjax.weather.evidence`), and the mask of each is the one under which it covers
    its part (`cloudjax.ColumnCover`).
    """

    name = "evidence"

    def classes(self) -> dict[str, CloudClass]:
        """Give the classes that evidence can place."""
        return weather_classes()

    def fractions(self, cube, classes, *, omega_sign=-1.0) -> Fractions:
        """Divide the covers of layers."""
        return _divided(cube, classes, omega_sign)

    def held(self, fraction, axes) -> AbstractMask:
        """Hold the cover."""
        return cover_grid(fraction, *axes)

    def mask(self, one, steps) -> MaskOf:
        """Take the mask under which the class covers so much.

        **Raises:** `DataError` for a class that no mask moves.
        """
        if not one.mask_gain > 0:
            raise DataError(
                f"The class {one.name} has a mask_gain of {one.mask_gain:g}, by which "
                "no weather moves it: make it positive, or use --decision table1."
            )
        column = ColumnCover.of(one, steps)
        return lambda held: CoverMask(held, column)

    def words(self, cube) -> list[tuple[str, str]]:
        """Say which evidence serves for each layer and quantity."""
        said = SkyEvidence.of(cube.regular(1.0)).said
        return [
            (f"{name} cloud" if name in LAYERS else _LABELS[name], text)
            for name, text in said.items()
        ]


DECISIONS: dict[str, CoverDecision] = {
    decision.name: decision for decision in (AllEvidence(), Table1())
}


def decision_named(name: str) -> CoverDecision:
    """Return the decision of this name.

    **Raises:** `DataError` if there is none.
    """
    if name not in DECISIONS:
        raise DataError(
            f"There is no decision {name!r}: make it {' or '.join(DECISIONS)}."
        )
    return DECISIONS[name]


def fractions_at(
    level, conditions: Conditions, omega_sign: float = -1.0
) -> Float[np.ndarray, "lat lon"]:
    """Return the cloud fraction of a class from the weather at its altitude; NaN under
    ground.
    """
    humidity, temperature, omega = (
        jnp.asarray(level[name].to_numpy(), float) for name in ("r", "t", "w")
    )
    fraction = cloud_fraction(
        conditions,
        jnp.clip(humidity / 100, 0, 1),
        temperature,
        omega,
        omega_sign=omega_sign,
    )
    return np.where(np.isnan(humidity), np.nan, np.asarray(fraction, float))


def evidence_of(one: CloudClass) -> Evidence:
    """Return what a class says, or else the layer that the middle of it is in."""
    if one.conditions.evidence is not None:
        return one.conditions.evidence
    middle = (one.base_m + one.top_m) / 2
    low, high = middle < _LOW_BELOW_M, middle >= _MIDDLE_BELOW_M
    return Evidence("low" if low else "high" if high else "middle")


def _divided(
    cube: WeatherCube, classes: Mapping[str, CloudClass], omega_sign: float
) -> Fractions:
    sky = SkyEvidence.of(cube)
    found: Fractions = {}
    for layer, cover in sky.covers.items():
        of_layer = {
            name: one
            for name, one in classes.items()
            if evidence_of(one).layer == layer
        }
        found |= _of_layer(sky, cube, cover, of_layer, omega_sign)
    return {name: np.where(f < _LEAST_COVER, 0.0, f) for name, f in found.items()}


def _of_layer(sky, cube, cover, classes, omega_sign) -> Fractions:
    """First those classes that claim a part of their own, then the others."""
    found: Fractions = {}
    weights = {
        name: np.broadcast_to(
            np.asarray(evidence_of(one).weight(sky.quantities), float)
            * _table1_weight(cube, one.conditions, omega_sign),
            cover.shape,
        )
        for name, one in classes.items()
    }
    left = cover
    for name, one in classes.items():
        claims = evidence_of(one).claims
        if claims:
            asked = sky.quantities[claims] * weights.pop(name)
            found[name] = np.clip(asked, 0, np.asarray(left))
            left = np.asarray(left_by(left, found[name]))
    if weights:
        parts = shared(left, list(weights.values()))
        found |= {n: np.asarray(p, float) for n, p in zip(weights, parts, strict=True)}
    return found


def _table1_weight(cube: WeatherCube, conditions: Conditions, omega_sign: float):
    """How well vertical motion and temperature suit a class, where it has limits."""
    c = conditions
    limits = c.vertical_wind_min_pa_s, -c.vertical_wind_max_pa_s, -c.temperature_max_k
    if max(*limits) == -np.inf and c.temperature_min_k <= 0:
        return 1.0
    level = cube.at_altitude(float(c.sampling_altitude_m))
    t, w = (jnp.asarray(level[name].to_numpy(), float) for name in ("t", "w"))
    return np.asarray(suitability(c, t, w, omega_sign=omega_sign))
