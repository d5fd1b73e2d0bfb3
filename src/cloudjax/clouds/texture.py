"""Periodic fractal textures: Perlin, inverted Worley, and their average over a pixel.

Textures are data, not parameters: they are passed to compiled functions as arguments
and no gradient flows into their voxels. Positions and gradients have their components
on the first axis, which keeps each in one run of memory.
"""

import functools as ft
import threading
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from cloudjax.geometry.footprint import POINT, Footprint


class Unresolved(eqx.Module):
    """What averaging over the footprint took from a texture, as variances.

    **Fields:**

    - `common`: of the part that all points of a ray within the cloud share.
    - `own`: of the rest of the values.
    - `slope`: of each component of the gradient, per metre squared.
    """

    common: Float[Array, "*rays"]
    own: Float[Array, "*rays"]
    slope: Float[Array, "*rays"]

    @property
    def variance(self) -> Float[Array, "*rays"]:
        """Of the values, 1 at most."""
        return self.common + self.own


class Texture(eqx.Module):
    """A standardised scalar field on the periodic unit cube.

    **Fields:**

    - `voxels`: values at the nodes i/n.
    - `unresolved`: what averaging removed; the level set needs it (`cloud.py`).
    """

    voxels: Float[Array, "n n n"]
    unresolved: Unresolved

    def sample(self, u: Float[Array, "3 *points"]) -> Float[Array, " *points"]:
        """Trilinear interpolation at positions `u` in periods, periodic."""
        corner, (x, y, z) = self._corners(u, shared=False)
        return _lerp(_along_xy(corner, x, y), z)

    def sample_with_gradient(
        self, u: Float[Array, "3 *points"]
    ) -> tuple[Float[Array, " *points"], Float[Array, "3 *points"]]:
        """The value and its gradient per period, from the same eight voxels."""
        corner, (x, y, z) = self._corners(u, shared=True)
        n = self.voxels.shape[0]
        along_xy = _along_xy(corner, x, y)
        along_x = [[_lerp(_pair(corner, j, k), x) for k in (0, 1)] for j in (0, 1)]
        rise_x = [[_rise(_pair(corner, j, k)) for j in (0, 1)] for k in (0, 1)]
        rise_y = [along_x[1][k] - along_x[0][k] for k in (0, 1)]
        gradient = [
            _lerp([_lerp(rise_x[k], y) for k in (0, 1)], z),
            _lerp(rise_y, z),
            _rise(along_xy),
        ]
        return _lerp(along_xy, z), n * jnp.stack(gradient)

    def _corners(self, u, *, shared: bool):
        """The eight voxels around each point, and where it lies between them."""
        n = self.voxels.shape[0]
        scaled = u * n
        floor = jnp.floor(scaled)
        low = jnp.mod(floor.astype(jnp.int32), n)
        high = jnp.where(low + 1 == n, 0, low + 1)
        # The flat index with clipping is the form that XLA fuses best on a CPU.
        flat = jax.lax.stop_gradient(self.voxels).reshape(-1)
        x, y, z = (
            (low[axis] * stride, high[axis] * stride)
            for axis, stride in enumerate((n * n, n, 1))
        )
        read = [
            flat.at[x[i] + y[j] + z[k]].get(mode="clip")
            for i, j, k in np.ndindex(2, 2, 2)
        ]
        if shared:
            # Else XLA fuses the reads anew into each of the four results.
            read = jax.lax.optimization_barrier(read)
        return dict(zip(np.ndindex(2, 2, 2), read, strict=True)), scaled - floor


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
class Perlin:
    """Perlin's gradient noise, summed over octaves (Perlin 1985; section 2.1).

    **Fields:**

    - `cells`: of the coarsest lattice, per period and axis.
    - `octaves`: lattices, each with twice the cells of the one before.
    - `persistence`: amplitude of an octave relative to the one before.
    """

    cells: int
    octaves: int = 4
    persistence: float = 0.5

    @property
    def finest_cells(self) -> int:
        return self.cells * 2 ** (self.octaves - 1)

    def field(self, seed: int, resolution: int) -> Float[Array, "n n n"]:
        rng = np.random.default_rng(seed)
        total = jnp.zeros((resolution,) * 3, jnp.float32)
        for octave in range(self.octaves):
            lattice = _unit_vectors(rng, (self.cells * 2**octave,) * 3)
            total += self.persistence**octave * _gradient_noise(lattice, resolution)
        return total


@dataclass(frozen=True)
class InvertedWorley:
    """Minus the distance to the nearest of one random point per cell (Worley 1996).

    **Fields:** `cells` per period and axis.
    """

    cells: int

    @property
    def finest_cells(self) -> int:
        return self.cells

    def field(self, seed: int, resolution: int) -> Float[Array, "n n n"]:
        rng = np.random.default_rng(seed)
        points = rng.random((self.cells,) * 3 + (3,), dtype=np.float32)
        return -_nearest_point_distance(points, resolution)


Fractal = Perlin | InvertedWorley


def make_texture(
    fractal: Fractal,
    seed: int,
    resolution: int = 128,
    *,
    length_scale_m: float = 1.0,
    footprint: Footprint = POINT,
    way_m: float = 0.0,
) -> Texture:
    """A texture of mean 0 and variance 1, averaged over a footprint.

    **Arguments:**

    - `fractal`, `seed`: same seed, same texture.
    - `resolution`: voxels per axis.
    - `length_scale_m`: the period.
    - `footprint`: of the pixels. The average is a Gaussian with the variances of a box
      of that size, and leaves as few voxels as hold it.
    - `way_m`: within how much of a ray the common part of what is lost is common.
    """
    if fractal.finest_cells * 2 > resolution:
        raise ValueError(
            f"{fractal} has {fractal.finest_cells} cells per period and "
            f"{resolution} voxels cannot resolve them: use at least two per cell."
        )
    return _averaged(
        _spectrum(fractal, seed, resolution),
        jnp.asarray(footprint.covariance_m2 / length_scale_m**2, float),
        jnp.asarray(footprint.view * way_m / length_scale_m, float),
        jnp.asarray(length_scale_m, float),
        resolution,
        _voxels_for(footprint.spacing_m / length_scale_m, resolution),
    )


def _voxels_for(spacing: float, resolution: int) -> int:
    """Per axis, for a spacing in periods: of a few sizes, fast to transform."""
    needed = 1 / max(spacing, 1e-9)
    sizes = (m * 2**i for i in range(2, 15) for m in (2, 3))
    return min((s for s in sizes if needed <= s < resolution), default=resolution)


class _Spectrum(eqx.Module):
    """A texture before it is averaged.

    **Fields:**

    - `waves`: of mean 0, for an interpolant of variance 1.
    - `power`: by the number of waves per period, in all directions together.
    - `slope`: mean square of a component of the gradient, per period.
    """

    waves: Complex[Array, "n n m"]
    power: Float[Array, " shells"]
    slope: Float[Array, ""]

    def common(self, way: Float[Array, "3"]) -> Float[Array, ""]:
        """The share of a stretch's variance that all its points have in common.

        Two points have the correlation of the field at their distance; its mean over
        all pairs is sinc²(k·way) for each wave, and textures are alike in all
        directions.
        """
        cosines = (jnp.arange(32) + 0.5) / 32
        length = jnp.sqrt(jnp.sum(way**2))
        k = jnp.arange(self.power.shape[0])
        means = jnp.sinc(jnp.outer(k, cosines * length)) ** 2
        return jnp.sum(self.power * means.mean(-1))


def _spectrum(fractal: Fractal, seed: int, resolution: int) -> _Spectrum:
    """One thread makes it, the others wait for it."""
    with _SPECTRA:
        return _make_spectrum(fractal, seed, resolution)


_SPECTRA = threading.Lock()


@ft.lru_cache(maxsize=32)
def _make_spectrum(fractal: Fractal, seed: int, resolution: int) -> _Spectrum:
    waves = jnp.fft.rfftn(fractal.field(seed, resolution)).at[0, 0, 0].set(0)
    waves = waves / jnp.sqrt(jnp.sum(_power(waves / resolution**3)))
    power = _power(waves / resolution**3)
    shell = jnp.round(jnp.sqrt(sum(k**2 for k in _waves(resolution)))).astype(int)
    return _Spectrum(
        # What is kept is of use in any precision.
        waves.astype(jnp.complex64),
        jnp.zeros(resolution).at[shell].add(power).astype(jnp.float32),
        jnp.sum(power * _steepness(resolution)).astype(jnp.float32),
    )


@ft.partial(jax.jit, static_argnames=("n", "voxels"))
def _averaged(
    spectrum: _Spectrum,
    covariance: Float[Array, "3 3"],
    way: Float[Array, "3"],
    length_scale_m: Float[Array, ""],
    n: int,
    voxels: int,
) -> Texture:
    """Multiply by the Gaussian exp(-2π² kᵀΣk), and add up what is left.

    Fewer voxels hold the waves that they can, and what those blunt is lost as well.
    """
    k = _waves(voxels)
    squares = sum(covariance[a, b] * k[a] * k[b] for a in range(3) for b in range(3))
    waves = _lowest(spectrum.waves, n, voxels) * jnp.exp(-2 * jnp.pi**2 * squares)
    kept = _power(waves / n**3)
    common = jnp.sinc(way[0] * k[0] + way[1] * k[1] + way[2] * k[2]) ** 2
    lost = jnp.clip(1 - jnp.sum(kept), 0, 1)
    shared = jnp.clip(spectrum.common(way) - jnp.sum(kept * common), 0, lost)
    slope = jnp.maximum(spectrum.slope - jnp.sum(kept * _steepness(voxels)), 0)
    return Texture(
        jnp.fft.irfftn(waves * (voxels / n) ** 3, s=(voxels,) * 3),
        Unresolved(common=shared, own=lost - shared, slope=slope / length_scale_m**2),
    )


def _lowest(spectrum: Complex[Array, "n n m"], n: int, voxels: int):
    """The waves that so many voxels hold, without those of two voxels per wave."""
    if voxels == n:
        return spectrum
    half = voxels // 2
    for axis in (0, 1):
        low, high = (
            jax.lax.slice_in_dim(spectrum, *ends, axis=axis)
            for ends in ((0, half), (n - half, n))
        )
        first = (slice(None),) * axis + (slice(1),)
        spectrum = jnp.concatenate([low, high.at[first].set(0)], axis)
    return spectrum[..., : half + 1].at[..., half].set(0)


def _waves(n: int) -> tuple[np.ndarray, ...]:
    """Numbers of waves per period along each axis, on the host.

    In a compiled function XLA would take cosines of them anew for each wave.
    """
    k = [np.fft.fftfreq(n, 1 / n)] * 2 + [np.fft.rfftfreq(n, 1 / n)]
    return np.meshgrid(*(a.astype(np.float32) for a in k), indexing="ij", sparse=True)


def _power(amplitude: Complex[Array, "n n m"]) -> Float[Array, "n n m"]:
    """What each wave adds to the variance of the trilinear interpolant.

    Not only at the nodes: along one axis the mean of ((1-t) a + t b)² over t is
    (2 R₀ + R₁)/3 with the autocorrelations R, which multiplies the power of a wave by
    (2 + cos(2πk/n))/3. A real transform holds most waves once for two.
    """
    n = amplitude.shape[0]
    k = _waves(n)
    twice = np.where((k[2] == 0) | (2 * k[2] == n), 1, 2) * _blunting(k[2], n)
    power = jnp.real(amplitude) ** 2 + jnp.imag(amplitude) ** 2
    return power * _blunting(k[0], n) * _blunting(k[1], n) * twice


def _steepness(n: int) -> Float[Array, "n n m"]:
    """Mean square of a component of the interpolant's slope over its variance.

    Differences between nodes are the slopes, of no blunting along them.
    """
    x, y, z = (
        jnp.asarray((2 * n * np.sin(np.pi * k / n)) ** 2 / _blunting(k, n))
        for k in _waves(n)
    )
    return (x + y + z) / 3


def _blunting(k: np.ndarray, n: int) -> np.ndarray:
    return (2 + np.cos(2 * np.pi * k / n)) / 3


def _unit_vectors(rng: np.random.Generator, shape) -> Float[np.ndarray, "*shape 3"]:
    """Isotropic directions from uniform numbers, the stable part of numpy's streams."""
    z = 2 * rng.random(shape) - 1
    λ = 2 * np.pi * rng.random(shape)
    ρ = np.sqrt(1 - z**2)
    return np.stack([ρ * np.cos(λ), ρ * np.sin(λ), z], -1).astype(np.float32)


@ft.partial(jax.jit, static_argnames="resolution")
def _gradient_noise(lattice: Float[Array, "c c c 3"], resolution: int):
    low, high, offset = _cells(lattice.shape[0], resolution)
    # Perlin's quintic fade: second derivatives are continuous across cells.
    fade = offset**3 * (offset * (offset * 6 - 15) + 10)
    index = (low, high)
    towards, weight = (offset, offset - 1), (1 - fade, fade)

    def plane(x):
        total = jnp.zeros((resolution,) * 2, jnp.float32)
        for i, j, k in np.ndindex(2, 2, 2):
            corners = lattice[index[i][x], index[j][:, None], index[k][None]]
            dot = (
                corners[..., 0] * towards[i][x]
                + corners[..., 1] * towards[j][:, None]
                + corners[..., 2] * towards[k][None]
            )
            total += weight[i][x] * weight[j][:, None] * weight[k][None] * dot
        return total

    return jax.lax.map(plane, jnp.arange(resolution))


@ft.partial(jax.jit, static_argnames="resolution")
def _nearest_point_distance(points: Float[Array, "c c c 3"], resolution: int):
    cells = points.shape[0]
    low, _, offset = _cells(cells, resolution)
    index = [(low + step) % cells for step in (-1, 0, 1)]
    away = [step - offset for step in (-1, 0, 1)]

    def plane(x):
        nearest2 = jnp.full((resolution,) * 2, jnp.inf, jnp.float32)
        for i, j, k in np.ndindex(3, 3, 3):
            p = points[index[i][x], index[j][:, None], index[k][None]]
            distance2 = (
                (p[..., 0] + away[i][x]) ** 2
                + (p[..., 1] + away[j][:, None]) ** 2
                + (p[..., 2] + away[k][None]) ** 2
            )
            nearest2 = jnp.minimum(nearest2, distance2)
        return jnp.sqrt(nearest2)

    # Plane by plane: the neighbours of all voxels at once take gigabytes.
    return jax.lax.map(plane, jnp.arange(resolution))


def _cells(cells: int, resolution: int):
    """Of each node along an axis: its cell, the next one, and its place within."""
    position = jnp.arange(resolution, dtype=jnp.float32) * (cells / resolution)
    low = jnp.floor(position).astype(jnp.int32)
    return low, (low + 1) % cells, position - low
