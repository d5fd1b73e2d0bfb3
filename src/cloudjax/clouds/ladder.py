"""Ladders are the same noise at many scales, each rung attenuated by the pixel.

"Each successive grid is scaled by 1/2, the values by the persistence" (Schinder et al.
2024, section 2.1). A rung is read at its own scale, turned and shifted on its own. What
a pixel leaves of it follows in closed form from the pixel's size on each ray.
"""

import functools as ft
import math
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.spatial.transform import Rotation

from cloudjax.geometry.footprint import Footprint, Sampling, across_m

from .noise import WAVES, Noise, bands


# Of a rung's variance: with so little left it is not read. What is left is scaled from
# there to 1, so that nothing jumps where reading ends, and nothing is lost at a point.
_LEAST = 1e-3
# Points of a chord at which a rung is read, linear in between: as many as what pixels
# leave needs, or if that is not few what the rung itself needs (docs/decisions.md).
_SPACING_IN_PIXELS = 0.6
_POINTS_PER_WAVE = 10.0
_FEW = 4
# Sub-pixel structure is taken for common over this part of a cloud's thickness, along
# the ray: measured against many hard rays per pixel (docs/decisions.md).
_COMMON_WAY = 0.35
# Between the seeds of two draws of one cloud: layers of a scene have seeds nearby.
_BETWEEN_DRAWS = 1_000_000


@dataclass(frozen=True)
class Ladder:
    """A `Ladder` is noise from long waves to short ones.

    **Fields:**

    - `noise`: of each rung.
    - `longest_m`, `shortest_m`: wavelengths; the last rung is no shorter.
    """

    noise: Noise
    longest_m: float
    shortest_m: float

    def __post_init__(self):
        if not 1.0 <= self.shortest_m <= self.longest_m <= 4e7:
            raise ValueError(
                "shortest_m must be 1 or more and no more than longest_m, and "
                "longest_m no more than the Earth's circumference, 4e7."
            )

    @property
    def wavelengths_m(self) -> tuple[float, ...]:
        """Give the wavelengths of the rungs, the longest first."""
        return tuple(self.longest_m / 2**octave for octave in self.octaves)

    @property
    def octaves(self) -> range:
        """Say by how many octaves each rung is shorter than the longest."""
        last = math.floor(math.log2(self.longest_m / self.shortest_m) + 1e-9)
        return range(0, last + 1, self.noise.octaves_per_rung)


# Points of a chord that no march has.
EVERY_STEP = 1 << 20


@dataclass(frozen=True)
class Rung:
    """One scale of one ladder; of noise that is cut into bands, one band of it.

    **Fields:**

    - `ladder`, `step`: its number in all ladders, and that of its gain.
    - `octave`: by how many octaves it is shorter than the ladder's longest.
    - `wavelength_m`, `noise`, `band`: what it is.
    """

    ladder: int
    step: int
    octave: int
    wavelength_m: float
    noise: Noise
    band: int

    @property
    def period_m(self) -> float:
        """Give the period of the noise."""
        return WAVES * self.wavelength_m

    @property
    def spectrum(
        self,
    ) -> tuple[Float[np.ndarray, " nodes"], Float[np.ndarray, " nodes"]]:
        """Give radians per metre, and the variance that each stands for."""
        band = bands(self.noise)[self.band]
        return band.wavenumbers / self.period_m, band.powers

    @property
    def power(self) -> float:
        """Give its variance at an amplitude of 1; it is 1 where noise has one band."""
        return float(self.spectrum[1].sum())

    @property
    def mean_wave_m(self) -> float:
        """Give the wavelength of the mean of its wavenumbers."""
        k, powers = self.spectrum
        return 2 * np.pi / float(np.average(k, weights=powers))

    def points(self, sampling: Sampling, depth_m: float) -> int:
        """Return at how many points of a chord it is worth reading; 0 where not at all.

        Powers of 2, so that many rungs are read together.

        **Arguments:** `depth_m`: of the shell.
        """
        k, powers = self.spectrum
        across = across_m(sampling.finest_m)
        if powers @ np.exp(-((k * across) ** 2)) <= _LEAST * powers.sum():
            return 0
        chord_m = sampling.way_m(depth_m)
        if not math.isfinite(chord_m):
            return EVERY_STEP
        enough = depth_m / (_SPACING_IN_PIXELS * max(sampling.finest_m, 1e-3))
        if enough > _FEW:
            enough = min(enough, chord_m * _POINTS_PER_WAVE / self.mean_wave_m)
        return 2 ** math.ceil(math.log2(max(enough, 1)))


@ft.cache
def rungs(ladders: tuple[Ladder, ...]) -> tuple[Rung, ...]:
    """List the rungs of all ladders, ladder by ladder."""
    steps = [
        (i, j, w) for i, x in enumerate(ladders) for j, w in enumerate(x.wavelengths_m)
    ]
    return tuple(
        Rung(
            i,
            step,
            j * ladders[i].noise.octaves_per_rung,
            wave_m,
            ladders[i].noise,
            band,
        )
        for step, (i, j, wave_m) in enumerate(steps)
        for band in range(len(bands(ladders[i].noise)))
    )


def seed_of_draw(seed: int, number: int) -> int:
    """Return the seed of another draw of the clouds of a seed; draw 0 has itself."""
    return seed + _BETWEEN_DRAWS * number


@ft.cache
def frames(
    ladders: tuple[Ladder, ...], seed: int
) -> tuple[Float[np.ndarray, "rungs 3 3"], Float[np.ndarray, "rungs 3"]]:
    """Return how positions [m] become positions in the noise [periods], and shifts.

    Each rung is turned and shifted by numbers of its own, so that no lattice shows and
    longer ladders have the same first rungs. In float32, which all that reads the noise
    shares.
    """
    turned, shifts = [], []
    for rung in rungs(ladders):
        rng = np.random.default_rng([seed, rung.ladder, rung.octave])
        rotation = Rotation.from_quat(rng.standard_normal(4)).as_matrix()
        turned.append(rotation / rung.period_m)
        shifts.append(rng.random(3))
    return np.array(turned, np.float32), np.array(shifts, np.float32)


def kept(
    wavenumbers: Float[Array, "rungs nodes"],
    powers: Float[Array, "rungs nodes"],
    pixel: Footprint,
) -> tuple[
    Float[Array, "rungs rays"], Float[Array, "rungs rays"], Float[Array, "rungs rays"]
]:
    """Return the amplitude of each rung that pixels leave, and what they take: of its
    variance, and of the variance of each component of its gradient [1/m²].

    The average over a Gaussian pixel multiplies the power of a wave k by exp(-kᵀΣk).
    Noise is alike in all directions: with deviations σ_w across and σ_l along the
    pixel, the mean over them is

        A² = Σ_b p_b exp(-k_b² σ_w²) (√π/2) erf(q_b)/q_b,  q_b = k_b √(σ_l² - σ_w²).

    **Arguments:** `wavenumbers` [rad/m], `powers`: of the rungs' spectra.
    """
    across2 = pixel.across_m[None] ** 2
    more2 = pixel.along_m[None] ** 2 - across2
    left = slope = whole = steepness = 0.0
    for i in range(powers.shape[-1]):
        power, square = powers[:, i, None], wavenumbers[:, i, None] ** 2
        share = jnp.exp(-square * across2) * _erf_over(square * more2)
        left, whole = left + power * share, whole + power
        slope, steepness = slope + power * square * share, steepness + power * square
    left = jnp.maximum(left - _LEAST * whole, 0) / (1 - _LEAST)
    # The inner choice keeps the slope of the root finite.
    some = left > 0
    amplitude = jnp.where(some, jnp.sqrt(jnp.where(some, left / whole, 1)), 0)
    lost_slope = jnp.maximum(steepness - slope, 0) / 3
    return amplitude, jnp.maximum(whole - left, 0), lost_slope


def _erf_over(square: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """(√π/2) erf(q)/q by a rational function of q², within 2.4 %."""
    y = square
    return 1 / jnp.sqrt(1 + y * (2 / 3 + 0.6 * y) / (1 + 0.47 * y))


def common_share(
    wavelength_m: Float[Array, " rungs"],
    thickness_m: float,
    stretch: Float[Array, " rays"],
) -> Float[Array, "rungs rays"]:
    """Return the part of unresolved variance that all points of a ray in a cloud have
    in common.

    Points have the correlation of the noise at their distance; its mean over all pairs
    of a stretch falls from 1, for waves that are longer than the stretch, as
    (1 + 4.39 t² + 16 t⁴)^(-1/4) with t the stretch over the wavelength.
    """
    t = _COMMON_WAY * thickness_m * stretch[None] / wavelength_m[:, None]
    # Two roots take a fifth of the time of a power.
    return 1 / jnp.sqrt(jnp.sqrt(1 + 4.39 * t**2 + 16 * t**4))


def amplitudes(
    ladders: tuple[Ladder, ...],
    weights: Float[Array, " ladders"],
    persistences: Float[Array, " ladders"],
    gains: Float[Array, " steps"],
) -> Float[Array, " rungs"]:
    """Return the amplitude of each rung.

    **Arguments:**

    - `weights`: standard deviation of each ladder, all rungs together, without gains.
    - `persistences`: amplitude of an octave over that of the next longer one.
    - `gains`: a factor for each step of each ladder.
    """
    every = rungs(ladders)
    own = np.array([rung.ladder for rung in every])
    step = np.array([rung.step for rung in every])
    octave = np.array([rung.octave for rung in every], float)
    # All octaves of all ladders in one array: operations on single numbers would each
    # be compiled, and differentiated, once more.
    most = max(len(ladder.octaves) for ladder in ladders)
    held = np.full((len(ladders), most), -1.0)
    for row, ladder in zip(held, ladders, strict=True):
        row[: len(ladder.octaves)] = ladder.octaves
    squares = persistences[:, None] ** np.maximum(2 * held, 0)
    norms = jnp.sqrt(jnp.where(held >= 0, squares, 0.0).sum(-1))
    share = persistences[own] ** octave / norms[own]
    return gains[step] * weights[own] * share
