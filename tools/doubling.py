"""Reflection and transmission of homogeneous slabs by doubling: the emulator's teacher.

Hansen & Travis (1974, Space Sci. Rev. 16, 527, section 3), with 16 double-Gauss nodes
per hemisphere, delta-M scaling and the exact first order put back (Nakajima & Tanaka
1988, "TMS"). A run gives every power of two of an optical depth at once. Angles that
are asked for are nodes without weight.
"""

from dataclasses import dataclass

import numpy as np


STREAMS = 32
DOUBLINGS = 34


@dataclass(frozen=True)
class Slabs:
    """Slabs of one material at several optical depths.

    **Fields:**

    - `optical_depth`: [depths], before delta-M scaling.
    - `modes`: [depths modes angles angles], of πL/(μ₀F₀), without the first order.
    - `albedo`, `transmittance`: [depths angles], of the flux from each angle.
    - `spherical_albedo`: [depths].
    """

    optical_depth: np.ndarray
    modes: np.ndarray
    albedo: np.ndarray
    transmittance: np.ndarray
    spherical_albedo: np.ndarray


@dataclass(frozen=True)
class Phase:
    """One of the phase functions of `cloudjax.light.phase`, independent of its code.

    **Fields:** `kind`: 0 for Henyey-Greenstein, 1 for Cornette-Shanks, 2 for double
    HG; `first`, `second`, `share`: asymmetries of the lobes, share of the first.
    """

    kind: int
    first: float
    second: float = 0.0
    share: float = 1.0

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        value = self.share * _henyey_greenstein(self.first, cosine)
        value = value + (1 - self.share) * _henyey_greenstein(self.second, cosine)
        if self.kind == 1:
            value = value * 1.5 * (1 + cosine**2) / (2 + self.first**2)
        return value

    def moments(self, count: int) -> np.ndarray:
        """Legendre moments; the first is 1, the second the asymmetry."""
        order = np.arange(count + 2)
        value = self.share * self.first**order + (1 - self.share) * self.second**order
        if self.kind == 1:
            twice = _times_cosine(_times_cosine(value))
            value = 1.5 / (2 + self.first**2) * (value[:count] + twice)
        return value[:count] / value[0]


def _henyey_greenstein(g, cosine):
    return (1 - g**2) / (1 + g**2 - 2 * g * cosine) ** 1.5


def _times_cosine(χ):
    """Moments of x P(x), one fewer, by the recurrence of Legendre polynomials."""
    order = np.arange(len(χ) - 1)
    before = np.concatenate([[0.0], χ[:-2]])
    return ((order + 1) * χ[1:] + order * before) / (2 * order + 1)


def first_order(albedo: float, phase, depth, view, sun):
    """πL/(μ₀F₀) of light that was scattered once."""
    slant = depth * (1 / view + 1 / sun)
    return albedo * phase * -np.expm1(-slant) / (4 * (view + sun))


def first_order_delta_m(co_albedo, phase: Phase, depth, view, sun, scattering):
    """The same with the beam that delta-M scaling leaves: what `Slabs.modes` lack."""
    ω = 1 - co_albedo
    scale = 1 - ω * phase.moments(STREAMS + 1)[-1]
    return first_order(ω / scale, phase(scattering), depth * scale, view, sun)


def solve(
    co_albedo: float,
    phase: Phase,
    cosines: np.ndarray,
    deepest: float,
    shallowest: float = 0.005,
    streams: int = STREAMS,
) -> Slabs:
    """All slabs of optical depth deepest/2ⁿ that are not below `shallowest`."""
    ω = 1 - co_albedo
    *χ, f = phase.moments(streams + 1)
    scale = 1 - ω * f
    ω_scaled = ω * (1 - f) / scale
    χ = (np.array(χ) - f) / (1 - f)
    nodes, weights = np.polynomial.legendre.leggauss(streams // 2)
    nodes, weights = (nodes + 1) / 2, weights / 2
    n = len(nodes)
    μ = np.concatenate([nodes, cosines])
    w = 2 * nodes * weights

    forward, backward = _phase_modes(χ, μ, streams)
    depth = deepest * scale / 2.0**DOUBLINGS
    reflected = _single(ω_scaled, backward, depth, μ, sign=1)
    passed = _single(ω_scaled, forward, depth, μ, sign=-1)
    kept = []
    for _ in range(DOUBLINGS):
        reflected, passed = _double(reflected, passed, np.exp(-depth / μ), w)
        depth *= 2
        if depth / scale >= shallowest * 0.999:
            once = _single(ω_scaled, backward, depth, μ, sign=1)
            direct = np.exp(-depth / μ[n:])
            albedo = np.einsum("k,ki->i", w, reflected[0, :n, n:])
            through = np.einsum("k,ki->i", w, passed[0, :n, n:]) + direct
            spherical = w @ reflected[0, :n, :n] @ w
            many = (reflected - once)[:, n:, n:]
            kept.append((depth / scale, many, albedo, through, spherical))
    return Slabs(*(np.array(x) for x in zip(*kept, strict=True)))


def _phase_modes(χ, μ, streams):
    """Fourier modes of the phase function, forwards and backwards, [modes μ μ]."""
    size = len(μ)
    modes = max(1, int(np.sum(np.abs(χ) > 1e-7)))
    forward = np.zeros((modes, size, size))
    backward = np.zeros((modes, size, size))
    seed = np.ones(size)
    sine = np.sqrt(1 - μ**2)
    for m in range(modes):
        # Normalised associated Legendre functions by their upward recurrence.
        if m > 0:
            seed = seed * sine * np.sqrt((2 * m - 1) / (2 * m))
        before, now = np.zeros(size), seed
        for degree in range(m, streams):
            term = (2 * degree + 1) * χ[degree] * np.outer(now, now)
            forward[m] += term
            backward[m] += term if (degree - m) % 2 == 0 else -term
            up = (2 * degree + 1) * μ * now - np.sqrt(degree**2 - m**2) * before
            before, now = now, up / np.sqrt((degree + 1) ** 2 - m**2)
    return forward, backward


def _single(ω, phase, depth, μ, sign):
    out, into = μ[:, None], μ[None, :]
    if sign > 0:
        factor = -np.expm1(-depth * (1 / out + 1 / into)) / (out + into)
    else:
        # exp(-τ/μ) times (1 - exp(-τ δ))/δ, δ = 1/μ₀ - 1/μ, over μ μ₀
        δ = 1 / into - 1 / out
        small = np.abs(depth * δ) < 1e-9
        ratio = np.where(small, depth, -np.expm1(-depth * δ) / np.where(small, 1.0, δ))
        factor = np.exp(-depth / out) * ratio / (out * into)
    return ω / 4 * phase * factor


def _double(reflected, passed, beam, w):
    """Two equal layers on each other; `beam` is what goes straight through one."""
    n = len(w)

    def then(a, b):
        return (a[:, :, :n] * w) @ b[:, :n, :]

    once = then(reflected, reflected)
    system = np.eye(n) - once[:, :n, :n] * w
    inner = np.linalg.solve(system, once[:, :n, :])
    between = once + (once[:, :, :n] * w) @ inner
    down = passed + then(between, passed) + between * beam
    up = then(reflected, down) + reflected * beam
    reflected = reflected + beam[:, None] * up + then(passed, up)
    passed = beam[:, None] * down + passed * beam + then(passed, down)
    return reflected, passed


def in_azimuth(modes: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """Sum [..., modes] at azimuths [...], 0 where the viewer has the sun ahead."""
    m = np.arange(modes.shape[-1])
    factor = np.where(m == 0, 1.0, 2.0)
    return np.einsum("...m,...m->...", modes * factor, np.cos(m * azimuth[..., None]))
