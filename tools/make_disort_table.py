"""Write tests/physics/disort_slabs.csv: random slabs solved with 32 streams.

Homogeneous slabs over a black surface by PythonicDISORT, with delta-M scaling and the
corrections of Nakajima & Tanaka. Depth, co-albedo: uniform in their logarithms over
0.01 to 200 and 1e-6 to 0.5; asymmetry over 0 to 0.9; the sun's cosine over 0.05 to 1;
the viewer's at a quadrature point, where no interpolation is needed.
"""

from pathlib import Path

import numpy as np
from doubling import Phase
from PythonicDISORT import pydisort


OUT = Path(__file__).parents[1] / "tests/physics/disort_slabs.csv"
STREAMS, MOMENTS = 32, 300
KINDS = np.repeat([0, 1, 2], [400, 60, 60])
LEAST_COSINE = 0.05
HEADER = (
    "0: Henyey-Greenstein (g), 1: Cornette-Shanks (g), 2: double HG (g1 g2 share)\n"
    "kind,p1,p2,p3,co_albedo,optical_depth,sun,view,scattering,"
    "albedo,transmittance,reflectance"
)


def solve(χ, co_albedo: float, depth: float, sun: float):
    """Cosines of the viewer, albedo, transmittance, and πL/(μ₀F₀) of an azimuth."""
    cosines, up, down, _, intensity = pydisort(
        np.array([depth]), np.array([1 - co_albedo]), STREAMS, χ[None, :], sun, 1.0,
        0.0, f_arr=χ[STREAMS], NT_cor=True,
    )  # fmt: skip
    views = cosines[: STREAMS // 2]

    def reflectance(azimuth):
        return np.pi * np.squeeze(intensity(0.0, azimuth))[: STREAMS // 2] / sun

    return views, up(0.0) / sun, sum(down(depth)) / sun, reflectance


def row(rng: np.random.Generator, kind: int) -> list[float]:
    if kind == 2:
        p = np.array([rng.uniform(0.6, 0.9), rng.uniform(-0.6, 0), rng.uniform(0.8, 1)])
    else:
        p = np.array([rng.uniform(0, 0.9), 0.0, 1.0])
    co_albedo, depth = 10 ** rng.uniform([-6, -2], np.log10([0.5, 200]))
    sun = rng.uniform(LEAST_COSINE, 1)
    azimuth = rng.uniform(0, np.pi)
    χ = Phase(kind, *p).moments(MOMENTS)
    solved = solve(χ, co_albedo, depth, sun)
    views, albedo, through, reflectance = solved
    i = rng.choice(np.flatnonzero(views >= LEAST_COSINE))
    view = views[i]
    sines = np.sqrt((1 - sun**2) * (1 - view**2))
    scattering = sines * np.cos(azimuth) - sun * view
    return [
        kind, *p, co_albedo, depth, sun, view, scattering,
        albedo, through, reflectance(azimuth)[i],
    ]  # fmt: skip


def main() -> None:
    rng = np.random.default_rng(2027)
    table = [
        row(rng, kind) for kind, n in ((0, 400), (1, 60), (2, 60)) for _ in range(n)
    ]
    np.savetxt(OUT, table, fmt="%.6g", delimiter=",", header=HEADER)
    print(f"{OUT}: {len(table)} slabs")


if __name__ == "__main__":
    main()
