"""Periodic noise of about one wavelength is read again and again at all scales.

Noise is data, not a parameter: it is passed to compiled functions as an argument and no
gradient flows into its voxels. Positions and gradients have their components on the
first axis, which keeps each in one run of memory.
"""

import functools as ft
import itertools
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int


# Voxels per axis of a period, a power of 2: 1 MB, which a core's cache holds. Waves of
# 16 per period, the shortest of Gaussian noise, have four.
VOXELS = 64
# Wavelengths per period. A rung repeats after so many, turned against all others.
WAVES = 8
# Of the spectrum of a band, for what a pixel leaves of it.
_NODES = 3
# All cloud is cut from the same noise, by rotations and shifts that hang on the seed.
_SEED = 2024


class NoiseBands(eqx.Module):
    """`NoiseBands` are parts of the spectra of some kinds of noise, on the unit cube.

    **Fields:**

    - `voxels`: values at the nodes i/n. The bands of one kind together have mean 0 and
      variance 1 in their trilinear interpolants.
    - `corners`: the same, of each node the eight of the cell that begins there, for
      gradients: a read of eight numbers in a row takes a quarter of the time of eight.
    - `wavenumbers`, `powers`: Gauss nodes of the spectra: radians per period, and the
      variance that each stands for.
    """

    voxels: Float[Array, "bands n n n"]
    corners: Float[Array, "bands cells 8"]
    wavenumbers: Float[Array, "bands nodes"]
    powers: Float[Array, "bands nodes"]

    def sample(
        self, band: Int[Array, " rungs"], u: Float[Array, "3 rungs *points"]
    ) -> Float[Array, "rungs *points"]:
        """Interpolate trilinearly at positions `u` in periods, each rung in a band."""

        def one(of_rung):
            corner, (x, y, z) = self._eight(*of_rung)
            return _lerp(_along_xy(corner, x, y), z)

        # One rung after the other: what is read for all at once leaves the cache.
        return jax.lax.map(one, (band, _rung_by_rung(u))).reshape(u.shape[1:])

    def sample_with_gradient(
        self, band: Int[Array, " rungs"], u: Float[Array, "3 rungs *points"]
    ) -> tuple[Float[Array, "rungs *points"], Float[Array, "3 rungs *points"]]:
        """Return the value and its gradient per period, from the same eight voxels."""
        n = self.voxels.shape[-1]

        def one(of_rung):
            corner, (x, y, z) = self._cell(*of_rung)
            along_xy = _along_xy(corner, x, y)
            along_x = [[_lerp(_pair(corner, j, k), x) for k in (0, 1)] for j in (0, 1)]
            rise_x = [[_rise(_pair(corner, j, k)) for j in (0, 1)] for k in (0, 1)]
            rise_y = [along_x[1][k] - along_x[0][k] for k in (0, 1)]
            rise = (
                _lerp([_lerp(rise_x[k], y) for k in (0, 1)], z),
                _lerp(rise_y, z),
                _rise(along_xy),
            )
            return jnp.stack([_lerp(along_xy, z), *rise])

        found = jax.lax.map(one, (band, _rung_by_rung(u)))
        value, *rise = jnp.moveaxis(found, 1, 0)
        return value.reshape(u.shape[1:]), n * jnp.stack(rise).reshape(u.shape)

    def _eight(self, band: Int[Array, ""], u: Float[Array, "3 *points"]):
        """The voxels around each point, and where it lies between them."""
        n = self.voxels.shape[-1]
        first, low, offset = self._node(band, u)
        high = (low + 1) & (n - 1)
        # Of flat indices that are sure to be inside XLA makes the best code on a CPU.
        flat = jax.lax.stop_gradient(self.voxels).reshape(-1)
        x, y, z = (
            (low[axis] * stride, high[axis] * stride)
            for axis, stride in enumerate((n * n, n, 1))
        )
        read = {
            (i, j, k): flat.at[first + x[i] + y[j] + z[k]].get(mode="promise_in_bounds")
            for i, j, k in np.ndindex(2, 2, 2)
        }
        return read, offset

    def _cell(self, band: Int[Array, ""], u: Float[Array, "3 *points"]):
        """The same, in one read for each point."""
        n = self.voxels.shape[-1]
        first, (x, y, z), offset = self._node(band, u)
        flat = jax.lax.stop_gradient(self.corners).reshape(-1, 8)
        cell = flat.at[first + (x * n + y) * n + z].get(mode="promise_in_bounds")
        # Else XLA fuses the reads anew into each of the four results.
        cell = jax.lax.optimization_barrier(cell)
        read = {corner: cell[..., i] for i, corner in enumerate(np.ndindex(2, 2, 2))}
        return read, offset

    def _node(self, band: Int[Array, ""], u: Float[Array, "3 *points"]):
        """The first voxel of a band, the lowest node around each point, and where the
        point lies from there.
        """
        n = self.voxels.shape[-1]
        scaled = u * n
        floor = jnp.floor(scaled)
        # The remainder by a power of 2, which is never out of bounds.
        low = floor.astype(jnp.int32) & (n - 1)
        return jnp.asarray(band * n**3, jnp.int32), low, scaled - floor


def _rung_by_rung(u: Float[Array, "3 rungs *points"]) -> Float[Array, "rungs 3 *n"]:
    """A last axis of one point is left out, for XLA makes slow code of it."""
    one_each = u.ndim > 3 and u.shape[-1] == 1
    return jnp.moveaxis(u[..., 0] if one_each else u, 1, 0)


def _along_xy(corner, x, y):
    along_x = [[_lerp(_pair(corner, j, k), x) for j in (0, 1)] for k in (0, 1)]
    return [_lerp(along_x[k], y) for k in (0, 1)]


def _pair(corner, j, k):
    return corner[0, j, k], corner[1, j, k]


def _lerp(ends, fraction):
    return ends[0] + fraction * (ends[1] - ends[0])


def _rise(ends):
    return ends[1] - ends[0]


@dataclass(frozen=True)
class Gaussian:
    """Gaussian noise whose power is cos²(π/2 log2(k/k0)), over an octave to each side.

    The windows of successive octaves add up to one: a ladder of them has no gaps.
    """

    octaves_per_rung = 1
    # Wavelengths per period at which the spectrum is cut into bands.
    cuts = ()

    def field(self, rng: np.random.Generator) -> Float[np.ndarray, "n n n"]:
        """Make the noise, before it is standardised."""
        k = _wavenumbers()
        octave = np.log2(np.where(k > 0, k, 1e-9) / WAVES)
        window = np.where(np.abs(octave) < 1, np.cos(np.pi / 2 * octave), 0)
        # So much power in equal parts of log k is k³ less in each wave.
        amplitude = window / np.maximum(k, 1) ** 1.5
        white = np.fft.rfftn(rng.standard_normal((VOXELS,) * 3))
        return np.fft.irfftn(white * amplitude, s=(VOXELS,) * 3, axes=(0, 1, 2))


@dataclass(frozen=True)
class Perlin:
    """`Perlin` is gradient noise on a lattice of one wavelength (Perlin 1985)."""

    octaves_per_rung = 1
    cuts = ()

    def field(self, rng: np.random.Generator) -> Float[np.ndarray, "n n n"]:
        """Make the noise, before it is standardised."""
        lattice = _unit_vectors(rng, (WAVES,) * 3)
        low, offset = _cells()
        # Perlin's quintic fade: second derivatives are continuous across cells.
        fade = offset**3 * (offset * (offset * 6 - 15) + 10)
        index, weight = (low, (low + 1) % WAVES), (1 - fade, fade)
        total = np.zeros((VOXELS,) * 3)
        for corner in np.ndindex(2, 2, 2):
            gradient = lattice[np.ix_(*(index[c] for c in corner))]
            towards = np.ix_(*(offset - c for c in corner))
            dot = sum(gradient[..., axis] * towards[axis] for axis in range(3))
            x, y, z = np.ix_(*(weight[c] for c in corner))
            total += x * y * z * dot
        return total


@dataclass(frozen=True)
class InvertedWorley:
    """`InvertedWorley` is minus the distance to the nearest of random points, one in
    each cell (Worley 1996).

    Cells are a wavelength wide. Their creases have waves of all lengths, so that the
    spectrum is cut in two, and the next rung is two octaves away.
    """

    octaves_per_rung = 2
    cuts = (12,)

    def field(self, rng: np.random.Generator) -> Float[np.ndarray, "n n n"]:
        """Make the noise, before it is standardised."""
        points = rng.random((WAVES,) * 3 + (3,))
        low, offset = _cells()
        nearest2 = np.full((VOXELS,) * 3, np.inf)
        for step in np.ndindex(3, 3, 3):
            away = [s - 1 for s in step]
            near = points[np.ix_(*((low + a) % WAVES for a in away))]
            to_cell = np.ix_(*(a - offset for a in away))
            distance2 = sum((near[..., i] + to_cell[i]) ** 2 for i in range(3))
            nearest2 = np.minimum(nearest2, distance2)
        return -np.sqrt(nearest2)


Noise = Gaussian | Perlin | InvertedWorley


@dataclass(frozen=True, eq=False)
class NoiseBand:
    """A `NoiseBand` is a part of the spectrum of a kind of noise: see `NoiseBands`."""

    voxels: Float[np.ndarray, "n n n"]
    wavenumbers: Float[np.ndarray, " nodes"]
    powers: Float[np.ndarray, " nodes"]

    @property
    def corners(self) -> Float[np.ndarray, "cells 8"]:
        """Give of each node the eight of the cell that begins there."""
        moved = [
            np.roll(self.voxels, [-i for i in corner], (0, 1, 2)).reshape(-1)
            for corner in np.ndindex(2, 2, 2)
        ]
        return np.stack(moved, axis=-1)


@ft.cache
def bands(noise: Noise) -> tuple[NoiseBand, ...]:
    """Make the bands of a noise, from long waves to short ones; they are kept."""
    waves = np.fft.rfftn(noise.field(np.random.default_rng(_SEED))) / VOXELS**3
    waves[0, 0, 0] = 0
    waves /= np.sqrt(_power(waves).sum())
    k = _wavenumbers()
    edges = (0, *noise.cuts, np.inf)
    return tuple(
        _band(np.where((k >= low) & (k < high), waves, 0))
        for low, high in itertools.pairwise(edges)
    )


def _band(waves: np.ndarray) -> NoiseBand:
    power, k = _power(waves), _wavenumbers()
    nodes, shares = _gauss_nodes(2 * np.pi * k[power > 0], power[power > 0])
    voxels = np.fft.irfftn(waves, s=(VOXELS,) * 3, axes=(0, 1, 2)) * VOXELS**3
    return NoiseBand(voxels.astype(np.float32), nodes, shares)


@ft.cache
def noise_bands(noises: tuple[Noise, ...]) -> NoiseBands:
    """Bring the bands of some kinds of noise onto the device, one after the other."""
    every = [band for noise in noises for band in bands(noise)]
    with jax.ensure_compile_time_eval():
        return NoiseBands(
            *(
                jnp.asarray(
                    np.stack([getattr(band, name) for band in every]), jnp.float32
                )
                for name in ("voxels", "corners", "wavenumbers", "powers")
            )
        )


def _gauss_nodes(
    x: Float[np.ndarray, " waves"], weights: Float[np.ndarray, " waves"]
) -> tuple[Float[np.ndarray, " nodes"], Float[np.ndarray, " nodes"]]:
    """Return the nodes and weights of a Gauss quadrature for a discrete measure.

    Lanczos' recurrence gives the Jacobi matrix (Golub & Welsch 1969).
    """
    total, before = weights.sum(), np.zeros_like(x)
    now = np.sqrt(weights / total)
    diagonal, beside = [], []
    for _ in range(_NODES):
        following = x * now
        diagonal.append(now @ following)
        following -= diagonal[-1] * now + (beside[-1] * before if beside else 0)
        beside.append(np.linalg.norm(following))
        before, now = now, following / beside[-1]
    jacobi = np.diag(diagonal) + np.diag(beside[:-1], 1) + np.diag(beside[:-1], -1)
    nodes, vectors = np.linalg.eigh(jacobi)
    return nodes, total * vectors[0] ** 2


@ft.cache
def _wavenumbers() -> Float[np.ndarray, "n n m"]:
    """Waves per period, in all directions together."""
    k = np.fft.fftfreq(VOXELS, 1 / VOXELS)
    return np.sqrt(sum(a**2 for a in np.ix_(k, k, np.arange(VOXELS // 2 + 1))))


def _power(waves: np.ndarray) -> Float[np.ndarray, "n n m"]:
    """What each wave adds to the variance of the trilinear interpolant.

    Not only at the nodes: along one axis the mean of ((1-t) a + t b)² over t is
    (2 R₀ + R₁)/3 with the autocorrelations R, which multiplies the power of a wave by
    (2 + cos(2πk/n))/3. A real transform holds most waves once for two.
    """
    k = np.fft.fftfreq(VOXELS, 1 / VOXELS)
    half = np.arange(VOXELS // 2 + 1)
    twice = np.where((half == 0) | (half == VOXELS // 2), 1, 2)
    x, y, z = np.ix_(*((2 + np.cos(2 * np.pi * a / VOXELS)) / 3 for a in (k, k, half)))
    return np.abs(waves) ** 2 * x * y * z * twice


def _unit_vectors(rng: np.random.Generator, shape) -> Float[np.ndarray, "*shape 3"]:
    """Isotropic directions from uniform numbers, the stable part of numpy's streams."""
    z = 2 * rng.random(shape) - 1
    λ = 2 * np.pi * rng.random(shape)
    ρ = np.sqrt(1 - z**2)
    return np.stack([ρ * np.cos(λ), ρ * np.sin(λ), z], -1)


def _cells() -> tuple[np.ndarray, Float[np.ndarray, " n"]]:
    """Of each node along an axis: its cell, and its place within."""
    position = np.arange(VOXELS) * (WAVES / VOXELS)
    low = np.floor(position).astype(int)
    return low, position - low
