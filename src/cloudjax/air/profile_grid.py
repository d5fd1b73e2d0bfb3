"""Temperature and humidity of the air may differ from place to place, on a grid."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from cloudjax.geometry.latlon_grid import AnyArray, LatLonGrid

from .atmosphere import AbstractTemperature


Profiles = tuple[Float[AnyArray, "points levels"], Float[AnyArray, "points levels"]]


class ProfileGrid(eqx.Module):
    """A `ProfileGrid` holds profiles at `gases.LEVELS_M` that differ from place to
    place.

    **Fields:**

    - `temperature_k`, `specific_humidity`: at the nodes.
    - `grid`: the places of the nodes.
    """

    # On the device, for compiled functions would bring them there at every call.
    temperature_k: Float[Array, "lat lon levels"] = eqx.field(converter=jnp.asarray)
    specific_humidity: Float[Array, "lat lon levels"] = eqx.field(converter=jnp.asarray)
    grid: LatLonGrid

    def __call__(
        self,
        latitude_deg: Float[AnyArray, " points"],
        longitude_deg: Float[AnyArray, " points"],
    ) -> Profiles:
        """Interpolate temperature [K] and humidity [kg/kg] to places, bilinear; numpy
        in, numpy out.
        """
        kelvin, humidity = self.grid.sample_all(
            [self.temperature_k, self.specific_humidity], latitude_deg, longitude_deg
        )
        return kelvin, humidity


class TemperatureGrid(AbstractTemperature):
    """The temperature of the air differs from place to place, at equally spaced
    altitudes.

    For scenes without air; with air the temperature comes with its profiles.

    **Fields:**

    - `temperature_k`: at the nodes.
    - `spacing_m`: of the levels, the first of which is at 0 m.
    - `grid`: the places of the nodes.
    """

    temperature_k: Float[AnyArray, "lat lon levels"]
    grid: LatLonGrid
    spacing_m: float = eqx.field(static=True)

    def __call__(self, altitude_m):
        """Return the average over all places [K] at geometric altitudes [m]."""
        levels = self.spacing_m * np.arange(self.temperature_k.shape[-1])
        mean = self.temperature_k.mean(axis=(0, 1))
        return jnp.interp(jnp.asarray(altitude_m), jnp.asarray(levels, float), mean)

    def at(
        self,
        latitude_deg: Float[np.ndarray, " points"],
        longitude_deg: Float[np.ndarray, " points"],
        altitude_m: Float[np.ndarray, " points"],
    ) -> Float[np.ndarray, " points"]:
        """Interpolate the temperature [K] to places, on the host; bilinear, linear in
        altitude.
        """
        nodes = np.asarray(self.temperature_k)
        count = nodes.shape[-1]
        level = np.clip(altitude_m / self.spacing_m, 0, count - 1)
        below = np.minimum(level.astype(int), count - 2)
        flat = nodes.reshape(-1, count)
        corners = self.grid.corners(latitude_deg, longitude_deg)
        low, high = (
            sum(weight * flat[index, z] for index, weight in corners)
            for z in (below, below + 1)
        )
        return low + (level - below) * (high - low)
