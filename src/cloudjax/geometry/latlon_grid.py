"""Fields on regular grids of latitude and longitude are sampled bilinearly."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float, Int
from numpy.typing import ArrayLike


Scalar = Float[Array, ""] | float | int

AnyArray = Array | np.ndarray
# Steps may differ from their mean by this fraction: float32 axes of 1/3 degree do.
_UNIFORM = 1e-3


class UniformAxis(eqx.Module):
    """A `UniformAxis` has evenly spaced nodes, so that cells are found without a
    search.

    `first` and `step` in degrees, `size` nodes; a `periodic` axis goes on at its first
    node after its last, any other is held constant outside.
    """

    first: float = eqx.field(static=True)
    step: float = eqx.field(static=True)
    size: int = eqx.field(static=True)
    periodic: bool = eqx.field(static=True, default=False)

    @property
    def values(self) -> Float[np.ndarray, " size"]:
        """Give the nodes [degrees]."""
        return self.first + self.step * np.arange(self.size)

    def cell(
        self, position: Float[AnyArray, "*points"]
    ) -> tuple[
        Int[AnyArray, "*points"], Int[AnyArray, "*points"], Float[AnyArray, "*points"]
    ]:
        """Return the nodes below and above each position [degrees], and the fraction
        between.
        """
        xp = np if isinstance(position, np.ndarray) else jnp
        index = (position - self.first) / self.step
        if self.periodic:
            # the remainder proper is a call for each number, ten times as slow
            index = xp.maximum(index - self.size * xp.floor(index / self.size), 0)
            floor = xp.floor(index)
            # rounding may bring it up to `size` itself
            lower = floor.astype(int)
            lower = xp.where(lower == self.size, 0, lower)
            upper = xp.where(lower + 1 == self.size, 0, lower + 1)
            return lower, upper, index - floor
        index = xp.clip(index, 0, self.size - 1)
        lower = xp.minimum(xp.floor(index).astype(int), self.size - 2)
        return lower, lower + 1, index - lower


def _uniform_axis(values: ArrayLike, name: str, *, period: float = 0.0) -> UniformAxis:
    nodes = np.asarray(values, float)
    if nodes.ndim != 1 or nodes.size < 2:
        raise ValueError(
            f"{name} must be one-dimensional with at least two nodes; "
            f"its shape is {nodes.shape}."
        )
    step = (nodes[-1] - nodes[0]) / (nodes.size - 1)
    spread = np.max(np.abs(np.diff(nodes) - step))
    # written so that NaN fails
    if not (step > 0 and spread <= _UNIFORM * step):
        raise ValueError(
            f"{name} must ascend in equal steps; it runs from {nodes[0]} to "
            f"{nodes[-1]} with steps of {step:.4g} ± {spread:.2g}. "
            "Reverse, roll or regrid the field."
        )
    periodic = bool(abs(nodes.size * step - period) <= _UNIFORM * step)
    step = period / nodes.size if periodic else step
    return UniformAxis(float(nodes[0]), float(step), nodes.size, periodic)


class LatLonGrid(eqx.Module):
    """A `LatLonGrid` is regular in latitude and longitude; it holds no field, and is
    hashable.

    Longitude is periodic where the grid covers the circle. Build it from coordinate
    arrays with `LatLonGrid.from_axes`.
    """

    latitude: UniformAxis
    longitude: UniformAxis

    @classmethod
    def from_axes(
        cls, latitude_deg: ArrayLike, longitude_deg: ArrayLike
    ) -> "LatLonGrid":
        """Make the grid with these nodes.

        **Arguments:**

        - `latitude_deg`: [lat] degrees north, ascending, evenly spaced, within ±90.
        - `longitude_deg`: [lon] degrees east, ascending, evenly spaced, any origin.

        **Raises:** `ValueError` where an axis is not so. Axes must be concrete.
        """
        latitude = _uniform_axis(latitude_deg, "latitude_deg")
        longitude = _uniform_axis(longitude_deg, "longitude_deg", period=360.0)
        if np.max(np.abs(latitude.values)) > 90 + _UNIFORM:
            raise ValueError(
                f"latitude_deg must stay within ±90; it runs from {latitude.first} to "
                f"{latitude.values[-1]}."
            )
        if longitude.step * (longitude.size - 1) > 360 - _UNIFORM:
            raise ValueError(
                "longitude_deg covers more than the circle; drop the repeated meridian."
            )
        return cls(latitude, longitude)

    @property
    def shape(self) -> tuple[int, int]:
        """Count the nodes in latitude and longitude."""
        return self.latitude.size, self.longitude.size

    def unit_vectors(self) -> Float[np.ndarray, "lat lon 3"]:
        """Return the nodes as float64 unit vectors; x points to (0°, 0°), z to the
        north pole.
        """
        phi, lam = np.deg2rad(self.latitude.values), np.deg2rad(self.longitude.values)
        # cos(π/2) is not 0 in floating point, and a pole must be one point
        cos_phi = np.where(self._at_pole(), 0.0, np.cos(phi))
        x, y = np.outer(cos_phi, np.cos(lam)), np.outer(cos_phi, np.sin(lam))
        z = np.broadcast_to(np.sin(phi)[:, None], self.shape)
        return np.stack([x, y, z], axis=-1)

    def single_valued_poles(
        self, nodes: Float[Array, "*batch lat lon channels"]
    ) -> Float[Array, "*batch lat lon channels"]:
        """Replace rows on the poles by their mean over longitude."""
        if not self.longitude.periodic:
            return nodes
        mean = jnp.mean(nodes, axis=-2, keepdims=True)
        return jnp.where(jnp.asarray(self._at_pole())[:, None, None], mean, nodes)

    def corners(
        self,
        latitude_deg: Float[AnyArray, "*points"],
        longitude_deg: Float[AnyArray, "*points"],
    ) -> list[tuple[Int[AnyArray, "*points"], Float[AnyArray, "*points"]]]:
        """Return flat node index and bilinear weight of the four nodes round each
        point.
        """
        if not self.longitude.periodic:
            # It may lie across the date line: count from its own middle.
            axis = self.longitude
            middle = axis.first + axis.step * axis.size / 2
            longitude_deg = (longitude_deg - middle + 180) % 360 - 180 + middle
        south, north, up = self.latitude.cell(latitude_deg)
        west, east, right = self.longitude.cell(longitude_deg)
        rows = ((south, 1 - up), (north, up))
        columns = ((west, 1 - right), (east, right))
        return [
            (i * self.longitude.size + j, wi * wj)
            for i, wi in rows
            for j, wj in columns
        ]

    def sample(
        self,
        nodes: Float[AnyArray, "lat lon channels"],
        latitude_deg: Float[AnyArray, "*points"],
        longitude_deg: Float[AnyArray, "*points"],
    ) -> Float[AnyArray, "*points channels"]:
        """Interpolate a field bilinearly; outside a non-periodic axis it is held
        constant.

        numpy coordinates give a numpy result of their own precision, so that host code
        in float64 loses nothing to float32; all else, or a traced field, gives JAX.
        """
        return self.sample_all([nodes], latitude_deg, longitude_deg)[0]

    def sample_all(
        self,
        fields: Sequence[Float[AnyArray, "lat lon *channels"]],
        latitude_deg: Float[AnyArray, "*points"],
        longitude_deg: Float[AnyArray, "*points"],
    ) -> list[Float[AnyArray, "..."]]:
        """Interpolate some fields to the same places, as `sample` does one; they may
        have no channels.
        """
        if any(isinstance(nodes, Tracer) for nodes in fields):
            latitude_deg = jnp.asarray(latitude_deg)
            longitude_deg = jnp.asarray(longitude_deg)
        elif isinstance(latitude_deg, np.ndarray):
            fields = [np.asarray(nodes) for nodes in fields]
        corners = self.corners(latitude_deg, longitude_deg)
        return [
            weighted_nodes(nodes.reshape(-1, *nodes.shape[2:]), corners)
            for nodes in fields
        ]

    def _at_pole(self) -> np.ndarray:
        return np.abs(self.latitude.values) > 90 - _UNIFORM * self.latitude.step


def weighted_nodes(
    flat: Float[AnyArray, "nodes *channels"],
    corners: list[tuple[Int[AnyArray, "*points"], Float[AnyArray, "*points"]]],
) -> Float[AnyArray, "..."]:
    """Sum weight times node over the `corners` that `LatLonGrid.corners` found."""
    xp = np if isinstance(flat, np.ndarray) else jnp
    terms = [
        xp.take(flat, index, axis=0, mode="clip")
        * weight.reshape(weight.shape + (1,) * (flat.ndim - 1))
        for index, weight in corners
    ]
    return terms[0] + terms[1] + terms[2] + terms[3]
