"""The I3RC step cloud: python benchmarks/step_cloud.py FOLDER_OF_CONSENSUS_RESULTS

Nadir reflectance of phase 1, case 1, experiments 1, 2 and 4, by independent pixels and
with shadows of several numbers of steps, against the consensus of Monte Carlo codes:
error of the mean, and root-mean-square error of the 32 columns.
"""

import argparse
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from cloudjax import (
    GivenOptics,
    GriddedCloud,
    Layer,
    PlaneParallel,
    Rays,
    ReflectiveBands,
    Scene,
    Shadows,
    Shell,
    Slabs,
    UniformGround,
    look,
    radiances,
)
from cloudjax.geometry.geodesy import GRS80, ecef


COLUMNS, WIDE_M, SHELL = 32, 500.0, Shell(1000.0, 1250.0)
# Experiment: sun's zenith angle in degrees, single-scattering albedo.
EXPERIMENTS = {1: (0.0, 1.0), 2: (60.0, 1.0), 4: (60.0, 0.99)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    for experiment, (zenith_deg, albedo) in EXPERIMENTS.items():
        truth = np.loadtxt(folder / f"I3RC_cons_res_case1_exp{experiment}_Iu.txt")
        for steps in (0, 3, 6, 12, 48):
            found = nadir_reflectance(zenith_deg, albedo, steps)
            mean = 100 * (found.mean() / truth.mean() - 1)
            rms = np.sqrt(np.mean((found - truth) ** 2))
            name = f"shadows, {steps} steps" if steps else "independent pixels"
            print(f"experiment {experiment}, {name:<20}{mean:+6.1f} % RMSE {rms:.4f}")


def nadir_reflectance(zenith_deg: float, albedo: float, steps: int) -> np.ndarray:
    """πL/(μ₀E) of the middles of the columns, sun over the thin side of each step."""
    scene = step_cloud(albedo, Shadows(steps) if steps else None)
    east = (np.arange(COLUMNS) + 0.5) * WIDE_M / COLUMNS
    longitude, zero = np.degrees(east / GRS80.semi_major_m), np.zeros(COLUMNS)
    down = np.broadcast_to([-1.0, 0.0, 0.0], (COLUMNS, 3))
    rays = Rays(ecef(zero, longitude, zero) - 1e5 * down, down, 1e-4)
    θ = np.radians(zenith_deg)
    view = look(scene, rays, np.array([np.cos(θ), -np.sin(θ), 0.0]))
    seen = radiances(scene, view).reflective
    assert seen is not None
    return np.asarray(seen[0], float) / np.cos(θ)


def step_cloud(albedo: float, shadows: Shadows | None) -> Scene:
    """Optical depths of 2 and 18, over a black surface, in units of reflectance."""
    thin = jnp.arange(COLUMNS) < COLUMNS // 2
    density = jnp.where(thin, 2 / 18, 1.0)[:, None, None] * jnp.ones((1, 1, 16))
    cloud = GriddedCloud(
        density=density,
        shell=SHELL,
        corner_deg=(-0.5, 0.0),
        spacing_m=(WIDE_M / COLUMNS, 110574.0),
        periodic=True,
    )
    layer = Layer(
        cloud=cloud,
        extinction_per_m=jnp.asarray(18 / (SHELL.top_m - SHELL.bottom_m)),
        optics=GivenOptics(
            infrared_ratio=jnp.asarray(0.5),
            co_albedo=jnp.asarray([1 - albedo]),
            relative_absorption=jnp.zeros(0),
            asymmetry=jnp.asarray([0.85]),
        ),
        name="step cloud",
    )
    band = ReflectiveBands((2,), jnp.ones(1), path=jnp.zeros(1), gain=jnp.ones(1))
    slabs = Slabs(PlaneParallel.load())
    black = UniformGround(albedo=0.0)
    return Scene((layer,), band, None, slabs, shadows=shadows, ground=black)


if __name__ == "__main__":
    main()
