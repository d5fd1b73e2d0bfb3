"""A twin of reality: a scene of known parameters, seen through real files.

The scene is rendered with the truth, given the noise of the instrument, packed into
ABI L1b files, read back through the public reader and reduced to a target. What a
histogram cannot know, where the weather is and which draw of the clouds each pixel
sees, the twin and its fit share: what is left is what the fit finds by itself. Against
clouds of one draw it is benchmarks/intervals.py that measures fits.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from scipy.ndimage import gaussian_filter

from cloudjax import Scene
from cloudjax_data import ReflectiveCalibration, open_folder
from cloudjax_fit.objective import Problem, pose
from cloudjax_fit.observation import observe
from cloudjax_fit.parameters import Parameter, put_all, with_overrides
from cloudjax_fit.ray_choice import DRAWS
from cloudjax_fit.scene_parameters import scene_parameters
from cloudjax_fit.targets import Target
from cloudjax_scenes import Imagery, SceneFromImagery, simulate_image
from cloudjax_scenes.background import Background
from cloudjax_scenes.lights import PAPER
from tests.generated import default_calibration, window, write_abi_l1b


SHAPE = (60, 60)
BANDS = (1, 3, 13)
# As many as fits have: with half, the march leaves dents in the objective
# (docs/decisions.md).
STEPS = 24
# What each scene of clouds below is made of; the rest stays at its default.
TRUTH = {
    "cirrus.weight_fine": 0.7,
    "cirrus.weight_worley": 0.35,
    "cirrus.threshold": 0.25,
    "cirrus.top": 8600.0,
    "cirrus.extinction": 3e-4,
    "low_stratus.weight_fine": 0.65,
    "low_stratus.weight_worley": 0.7,
    "low_stratus.threshold": -0.3,
    "low_stratus.top": 2100.0,
    "low_stratus.extinction": 1.2e-3,
}


@dataclass(frozen=True, eq=False)
class Twin:
    """A posed problem and the truth behind it."""

    target: Target
    problem: Problem
    parameters: list[Parameter]

    @property
    def truth(self) -> np.ndarray:
        return np.array([TRUTH[p.name] for p in self.parameters])


def make_twin(folder: Path, seed: int = 3) -> Twin:
    """Render the truth, write it as files, read them, and pose the fit."""
    weather = _weather(folder / "first_guess", seed)
    made_of = SceneFromImagery(weather, seed=seed, steps=STEPS)
    scene = made_of.build()
    every = scene_parameters(made_of)
    free = [p for p in every if p.name in TRUTH]
    truth = put_all(scene, free, jnp.asarray([TRUTH[p.name] for p in free]))
    _write(folder / "twin", _images(truth, made_of), seed)
    seen = _observed(folder / "twin")
    target = _with_weather(seen, weather)
    vague = {p.name: {"spread": 2 * p.spread} for p in free}
    parameters = with_overrides(free, vague)
    problem, _ = pose(
        target,
        scene,
        parameters,
        rays=SHAPE[0] * SHAPE[1],
        seed=seed,
        texture=False,
    )
    return Twin(target, problem, parameters)


def _images(truth: Scene, made_of: SceneFromImagery) -> dict[int, np.ndarray]:
    """Radiances by band; each pixel sees the draw of the clouds that fits see there."""
    drawn = [simulate_image(truth.drawn_anew(n), made_of) for n in range(DRAWS)]
    draw = np.arange(SHAPE[0] * SHAPE[1]).reshape(SHAPE) % DRAWS
    return {b: np.choose(draw, [image.band(b) for image in drawn]) for b in BANDS}


def _observed(folder: Path) -> Target:
    scene = open_folder(folder).read(BANDS)
    return observe(scene, BANDS, classes=PAPER.imagery_classes())


def _weather(folder: Path, seed: int) -> Imagery:
    """Imagery with smooth fractions of both classes over a dark, warm sea."""
    rng = np.random.default_rng(seed)
    rough = gaussian_filter(rng.standard_normal(SHAPE), 3)
    images = {
        b: default_calibration(b).radiance(
            np.where(rough > 0, 0.6, 0.08)
            if isinstance(default_calibration(b), ReflectiveCalibration)
            else np.where(rough > 0.08, 240.0, 289.0)
        )
        for b in BANDS
    }
    _write(folder, images, seed)
    first = _observed(folder).imagery
    shape = len(first.latitude_deg), len(first.longitude_deg)
    fractions = {
        name: np.clip(0.5 + 0.3 * _smooth(rng, shape), 0.1, 0.9)
        for name in first.fractions
    }
    sea = {1: 0.10, 3: 0.03, 13: 289.0}
    radiance = {
        b: np.full(SHAPE, default_calibration(b).radiance(np.array([sea[b]])).item())
        for b in first.bands
    }
    background = Background(first.grid, radiance)
    return replace(first, fractions=fractions, background=background, evidence={})


def _smooth(rng: np.random.Generator, shape) -> np.ndarray:
    field = gaussian_filter(rng.standard_normal(shape), 2, mode="wrap")
    return (field - field.mean()) / field.std()


def _write(folder: Path, images, seed: int) -> None:
    folder.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    for band, radiance in images.items():
        calibration = default_calibration(band)
        noise = rng.standard_normal(SHAPE) * _noise(calibration)
        seen = np.asarray(radiance, float) + noise
        write_abi_l1b(folder, band=band, radiance=seen, grid=window(SHAPE))


def _noise(calibration) -> float:
    """ABI's requirement: SNR 300 at albedo 1, 0.1 K at 300 K."""
    if isinstance(calibration, ReflectiveCalibration):
        return calibration.radiance(np.ones(1)).item() / 300
    return np.diff(calibration.radiance(np.array([300.0, 300.1]))).item()


def _with_weather(seen: Target, weather: Imagery) -> Target:
    imagery = replace(
        seen.imagery,
        background=weather.background,
        fractions=weather.fractions,
        latitude_deg=weather.latitude_deg,
        longitude_deg=weather.longitude_deg,
        evidence={},
    )
    return replace(seen, imagery=imagery)
