"""Clouds of Gaussian kernels are exact along each ray: for some hundred particles.

Every ray meets every kernel, so that many are rather deposited on columns
(`cloudjax.particles.deposit`).
"""

import functools as ft

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import erf
from jaxtyping import Array, Float

from cloudjax.geometry.footprint import Sampling
from cloudjax.geometry.geodesy import east_north_up, ecef, geodetic
from cloudjax.geometry.path import Path, device_array, navigate
from cloudjax.geometry.rays import Rays
from cloudjax.geometry.shells import Chords, Shell

from .source import AbstractCloudSource, Occupancy, Slopes


# Standard deviations within which all but 4e-4 of the rays through a kernel see it.
_REACH = 4.0
# Kernels that are read at once: memory is rays times steps times these.
_AT_ONCE = 16


class KernelPath(eqx.Module):
    """A `KernelPath` is a ray's way among kernels, straight in their frame.

    **Fields:**

    - `path`: the geometry.
    - `entry_m`: east, north and up of the middle of the cloud.
    - `ahead`: unit vectors of the same axes.
    """

    path: Path
    entry_m: Float[Array, "rays 3"]
    ahead: Float[Array, "rays 3"]


class KernelSamples(eqx.Module):
    """`KernelSamples` hold the same, and whether normals will be asked; what is there
    are parameters."""

    path: Path
    entry_m: Float[Array, "rays 3"]
    ahead: Float[Array, "rays 3"]
    slopes: bool = eqx.field(static=True)

    def on(self, path: Path, at: Float[Array, "rays points"]) -> "KernelSamples":
        """Place them at another path's steps."""
        del at
        return KernelSamples(path, self.entry_m, self.ahead, slopes=False)


class KernelCloud(AbstractCloudSource):
    """Blobs of cloud, of which each is a Gaussian; make it with `KernelCloud.of`.

    With the extinction area A and the deviation σ, extinction is
    A (2π)^(-3/2) σ⁻³ exp(-r²/2σ²), and along a ray that passes at the distance b

        τ = A/(2πσ²) exp(-b²/2σ²) [erf((s₂ - s₀)/√2σ) - erf((s₁ - s₀)/√2σ)]/2.

    Pixels should be no wider than the kernels. All three arrays are parameters.

    **Fields:**

    - `place_m`: of the middles, to the east, to the north and upwards of the middle of
      the cloud.
    - `extinction_area_m2`: A, optical depth times area.
    - `deviation_m`: σ.
    - `middle`: latitude and longitude [degrees] and altitude [m] of the middle.
    - `reach_m`: from the middle, within which they all are.
    - `extinction_per_m`: of the layer, which an occupancy of 1 has.
    """

    place_m: Float[Array, "kernels 3"]
    extinction_area_m2: Float[Array, " kernels"]
    deviation_m: Float[Array, " kernels"]
    shell: Shell = eqx.field(static=True)
    middle: tuple[float, float, float] = eqx.field(static=True)
    reach_m: float = eqx.field(static=True)
    extinction_per_m: float = eqx.field(static=True)

    @classmethod
    def of(
        cls,
        position_m: Float[np.ndarray, "kernels 3"],
        extinction_area_m2: Float[np.ndarray, " kernels"],
        deviation_m: Float[np.ndarray, " kernels"],
    ) -> "KernelCloud":
        """Make it from ECEF positions [m].

        The shell holds all kernels to four deviations, and ends at the ground.

        **Raises:** `ValueError` without kernels, and where one has no size.
        """
        if not len(position_m):
            raise ValueError("There is no kernel: there is nothing to render.")
        if not (deviation_m > 0).all():
            raise ValueError("A kernel has no size: deviations are more than 0.")
        latitude, longitude, altitude = geodetic(position_m.mean(axis=0)[None])
        middle = float(latitude[0]), float(longitude[0]), float(altitude[0])
        height = geodetic(position_m)[2]
        reach = _REACH * deviation_m
        peak = extinction_area_m2 / ((2 * np.pi) ** 1.5 * deviation_m**3)
        place = (position_m - _origin(middle)) @ _axes(middle).T
        return cls(
            place_m=device_array(place),
            extinction_area_m2=device_array(extinction_area_m2),
            deviation_m=device_array(deviation_m),
            shell=Shell(
                max(float((height - reach).min()), 0.0), float((height + reach).max())
            ),
            middle=middle,
            reach_m=float((np.linalg.norm(place, axis=-1) + reach).max()),
            extinction_per_m=float(peak.max()),
        )

    def navigate(self, rays: Rays, chord: Chords, sampling: Sampling) -> KernelPath:
        """Lay rays among the kernels, on the host in float64."""
        del sampling
        axes = _axes(self.middle)
        entry = (rays.at(chord.entry_m) - _origin(self.middle)) @ axes.T
        return KernelPath(
            path=navigate(rays, chord),
            entry_m=device_array(entry),
            ahead=device_array(rays.direction @ axes.T),
        )

    def likelihood(self, samples: KernelPath | KernelSamples) -> Float[Array, " rays"]:
        """Count rays that pass the middle within reach as ones that may meet cloud."""
        middle = jnp.zeros((1, 3), samples.entry_m.dtype)
        _, across = _nearest(samples.entry_m, samples.ahead, middle)
        near = across[:, 0] < self.reach_m**2
        return jnp.where(near & (samples.path.length_m > 0), 1.0, 0.0)

    def sample(
        self, way: KernelPath, textures: tuple[()], *, steps: int, slopes: bool
    ) -> KernelSamples:
        """Keep the ways: nothing is read before the kernels are known."""
        del textures, steps
        return KernelSamples(way.path, way.entry_m, way.ahead, slopes)

    def branch(
        self,
        way: KernelPath,
        textures: tuple[()],
        distance_m: Float[Array, " rays"],
        direction: Float[Array, "rays 3"],
        ends_m: Float[Array, "rays ends"],
    ) -> KernelPath:
        """Leave the ways in another direction."""
        del textures
        axes = jnp.asarray(_axes(self.middle), direction.dtype)
        return KernelPath(
            path=way.path.branch(distance_m, direction, ends_m),
            entry_m=way.entry_m + way.ahead * distance_m[:, None],
            ahead=jnp.sum(direction[:, None] * axes[None], axis=-1),
        )

    def occupancy(self, samples: KernelSamples, steps: int) -> Occupancy:
        """Find the optical depth of each step, exactly, for its cloud."""
        ends = samples.path.step_ends_m(steps)
        depth = self._summed(
            ft.partial(_depth_of, samples.entry_m, samples.ahead, ends),
            jnp.zeros((len(ends), steps), ends.dtype),
        )
        # Steps of nothing have none.
        length = jnp.diff(ends)
        some = length > 0
        per_m = jnp.where(some, depth / jnp.where(some, length, 1.0), 0.0)
        fraction = per_m / self.extinction_per_m
        slopes = self._slopes(samples, steps) if samples.slopes else None
        return Occupancy(fraction[None], jnp.ones(1, fraction.dtype), slopes)

    def _slopes(self, samples: KernelSamples, steps: int) -> Slopes:
        distance = samples.path.distance_m(steps)
        local = self._summed(
            ft.partial(_gradient_of, samples.entry_m, samples.ahead, distance),
            jnp.zeros((3, *distance.shape), distance.dtype),
        )
        axes = jnp.asarray(_axes(self.middle), distance.dtype)
        gradient = jnp.einsum("crs,ca->ars", local, axes, precision="highest")
        none = jnp.zeros_like(distance)
        return Slopes(
            gradient / self.extinction_per_m,
            none,
            samples.path.up(distance),
            none[:, 0],
        )

    def _summed(self, part, start):
        """Add a part of some kernels after the other, and forget what it takes."""
        count = len(self.extinction_area_m2)
        groups = -(-count // _AT_ONCE)
        filled = groups * _AT_ONCE - count

        def grouped(values, filling):
            rest = jnp.full((filled, *values.shape[1:]), filling, values.dtype)
            return jnp.concatenate([values, rest]).reshape(
                groups, _AT_ONCE, *values.shape[1:]
            )

        kernels = (
            grouped(self.place_m, 0.0),
            grouped(self.extinction_area_m2, 0.0),
            grouped(self.deviation_m, 1.0),
        )
        step = jax.checkpoint(lambda total, some: (total + part(*some), None))
        return jax.lax.scan(step, start, kernels)[0]


def _depth_of(entry, ahead, ends, place, area, deviation) -> Float[Array, "rays steps"]:
    """Optical depth of kernels between the ends of steps."""
    along, across = _nearest(entry, ahead, place)
    tall = area / (2 * jnp.pi * deviation**2)
    seen = tall[None] * jnp.exp(-across / (2 * deviation[None] ** 2))
    scaled = (ends[:, None] - along[..., None]) / (
        jnp.sqrt(2.0).astype(ends.dtype) * deviation[None, :, None]
    )
    return jnp.sum(seen[..., None] * jnp.diff(erf(scaled)) / 2, axis=1)


def _gradient_of(entry, ahead, distance, place, area, deviation):
    """Gradient of the extinction at places on the rays, in the kernels' axes."""
    at = entry[:, None] + ahead[:, None] * distance[..., None]
    off = place[None, None] - at[:, :, None]
    square = deviation[None, None] ** 2
    dense = area / ((2 * jnp.pi) ** 1.5 * deviation**3)
    dense = dense[None, None] * jnp.exp(-jnp.sum(off**2, axis=-1) / (2 * square))
    return jnp.moveaxis(jnp.sum((dense / square)[..., None] * off, axis=2), -1, 0)


def _nearest(entry, ahead, place):
    """How far along rays they are nearest to kernels, and their distance there squared.

    The distance is that of a difference, not the difference of two squares, which
    single precision does not tell apart.
    """
    to = place[None] - entry[:, None]
    along = jnp.sum(to * ahead[:, None], axis=-1)
    across = to - along[..., None] * ahead[:, None]
    return along, jnp.sum(across**2, axis=-1)


def _axes(middle: tuple[float, float, float]) -> Float[np.ndarray, "3 3"]:
    return np.asarray(east_north_up(*middle[:2]))


def _origin(middle: tuple[float, float, float]) -> Float[np.ndarray, "3"]:
    latitude, longitude, altitude = (np.array(part) for part in middle)
    return ecef(latitude, longitude, altitude)
