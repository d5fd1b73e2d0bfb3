"""Coarse fields say what the clouds of a class are like from place to place.

One set of parameters describes a class; clouds are thicker here and higher there, and
smoother elsewhere. The fields hold by how much, at scales that the textures leave to
them. Imagery or an analysis gives them.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from cloudjax.geometry.latlon_grid import LatLonGrid


class CoarseFields(eqx.Module):
    """`CoarseFields` say what clouds are like from place to place, on a regular grid of
    latitude and longitude.

    **Fields:**

    - `nodes`: the logarithm of optical depth, the top [m] and the logarithm of the
      roughness, each relative to what the class is like elsewhere.
    - `grid`: of the nodes.
    """

    nodes: Float[Array, "lat lon 3"]
    grid: LatLonGrid

    def __check_init__(self):
        if self.nodes.shape[:2] != self.grid.shape:
            raise ValueError(
                f"The fields have shape {self.nodes.shape}, their axes "
                f"{self.grid.shape}."
            )
        if not isinstance(self.nodes, Tracer) and not jnp.isfinite(self.nodes).all():
            raise ValueError("Coarse fields must be finite: fill what is missing.")

    def __call__(
        self,
        latitude_deg: Float[np.ndarray, " points"],
        longitude_deg: Float[np.ndarray, " points"],
    ) -> Float[np.ndarray, "points 3"]:
        """Read the fields at these places [degrees], bilinearly."""
        return np.asarray(self.grid.sample(self.nodes, latitude_deg, longitude_deg))


class Response(eqx.Module):
    """A `Response` says how strongly clouds follow the coarse fields; 1 is as much as
    these say.

    **Fields:** `depth`, `top`, `roughness`: factors on each field.
    """

    depth: Float[Array, ""] = eqx.field(default_factory=lambda: jnp.asarray(1.0))
    top: Float[Array, ""] = eqx.field(default_factory=lambda: jnp.asarray(1.0))
    roughness: Float[Array, ""] = eqx.field(default_factory=lambda: jnp.asarray(1.0))


class Placed(eqx.Module):
    """What the coarse fields are on rays, in the middle of their ways.

    **Fields:** `values`: as the nodes of `CoarseFields`.
    """

    values: Float[Array, "rays 3"]

    def density(self, response: Response) -> Float[Array, " rays"]:
        """Return the factor on extinction."""
        return jnp.exp(response.depth * self.values[:, 0])

    def lift_m(self, response: Response) -> Float[Array, " rays"]:
        """Return by how much the barriers stand higher."""
        return response.top * self.values[:, 1]

    def roughness(self, response: Response) -> Float[Array, " rays"]:
        """Return the factor on textures and mask, and on what they must exceed."""
        return jnp.exp(response.roughness * self.values[:, 2])
