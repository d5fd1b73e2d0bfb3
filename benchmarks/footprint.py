"""What averaging over the footprint gains: python benchmarks/footprint.py [-o DIR]

Small squares of pixels are rendered with one soft ray per pixel and with one hard ray
per pixel, both with the steps of a usual march, and compared with the mean of 64 hard
rays per pixel and many steps: from geostationary orbit near the nadir and near the
limb, and from a low orbit with pixels of 20 m. Then the same clouds are seen from low
orbit on the line of sight of the geostationary satellite, and block averages are
compared with its pixels. Writes footprint.json and footprint.md (tables) to DIR.
"""

import argparse
import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from cloudjax import (
    CloudFunction,
    FractalCloud,
    Gaussian,
    GivenOptics,
    InvertedWorley,
    Ladder,
    Latent,
    Layer,
    Rays,
    ReflectiveBands,
    Sampling,
    Scene,
    Shell,
    TwoFlux,
    UniformGround,
    radiances,
)
from cloudjax.geometry.footprint import Footprint
from cloudjax.geometry.geodesy import GRS80, ecef, intersect
from cloudjax.image.render import render
from cloudjax.march.view import lay, make_textures, sample


SEEDS = 8
SIDE, PARTS = 24, 8
STEPS, NODES = 24, 5
GEOSTATIONARY_M = np.array([42164160.0, 0.0, 0.0])
GEOSTATIONARY_RAD = 5.6e-5
CHUNK = 4608


class HardCloud(FractalCloud):
    """The paper's level set: a step is cloud where the cloud function is positive."""

    def pixel(self, way, steps):
        return Footprint.level(0 * way.width_m, way.stretch)

    def occupancy(self, samples, steps):
        soft = super().occupancy(samples, steps)
        return eqx.tree_at(lambda o: o.fraction, soft, jnp.round(soft.fraction))


# Lines of sight ----------------------------------------------------------------------


@dataclasses.dataclass(frozen=True, eq=False)
class Square:
    """A square of pixels about a line of sight, which can be cut into finer rays.

    **Fields:**

    - `origin_m`, `target_m`: the line of sight, ECEF.
    - `pixel_rad`: of a pixel.
    - `side`: pixels per side.
    - `truth_steps`: that a hard march needs to resolve what a pixel does.
    """

    origin_m: np.ndarray
    target_m: np.ndarray
    pixel_rad: float
    side: int
    truth_steps: int = 160

    def rays(self, parts: int = 1) -> Rays:
        """Row by row, each pixel in parts²."""
        axis = self.target_m - self.origin_m
        axis = axis / np.linalg.norm(axis)
        right = np.cross([0, 0, 1.0], axis)
        right /= np.linalg.norm(right)
        offset = (np.arange(self.side * parts) + 0.5) / parts - self.side / 2
        y, x = np.meshgrid(*[offset * self.pixel_rad] * 2, indexing="ij")
        direction = (
            axis + x.reshape(-1, 1) * right + y.reshape(-1, 1) * np.cross(axis, right)
        )
        direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
        origin = np.broadcast_to(self.origin_m, direction.shape)
        return Rays(origin, direction, self.pixel_rad / parts)

    def averaged(self, values: np.ndarray) -> np.ndarray:
        """Means over the parts of each pixel."""
        parts = round((len(values) / self.side**2) ** 0.5)
        blocks = values.reshape(self.side, parts, self.side, parts)
        return blocks.mean((1, 3)).ravel()


def nadir(seed: int, side: int = SIDE) -> Square:
    rng = np.random.default_rng(seed)
    latitude, longitude = rng.uniform(-4, 4, 2)
    target = _place(latitude, longitude, 1500.0)
    return Square(GEOSTATIONARY_M, target, GEOSTATIONARY_RAD, side)


def limb(seed: int, side: int = SIDE) -> Square:
    rng = np.random.default_rng(seed)
    target = _place(rng.uniform(-3, 3), 68 + rng.uniform(-1, 1), 1500.0)
    return Square(GEOSTATIONARY_M, target, GEOSTATIONARY_RAD, side)


def low_orbit(seed: int, side: int = SIDE) -> Square:
    """From 700 km, three degrees north of the target, with pixels of 20 m."""
    latitude, longitude = np.random.default_rng(seed).uniform(-3, 3, 2)
    origin = _place(latitude + 3, longitude, 700e3)
    target = _place(latitude, longitude, 1500.0)
    distance = float(np.linalg.norm(target - origin))
    return Square(origin, target, 20 / distance, side, truth_steps=512)


VIEWS = {"GEO nadir": nadir, "GEO near the limb": limb, "LEO, 20 m": low_orbit}


def from_low_orbit(high: Square) -> Square:
    """The same pixels seen from where their line of sight passes 700 km."""
    axis = high.target_m - high.origin_m
    distance = np.linalg.norm(axis)
    axis = axis / distance
    near = float(intersect(high.origin_m[None], axis[None], GRS80.raised(700e3))[0][0])
    return dataclasses.replace(
        high,
        origin_m=high.origin_m + near * axis,
        pixel_rad=high.pixel_rad * float(distance) / (float(distance) - near),
    )


def _place(latitude, longitude, altitude_m) -> np.ndarray:
    φ, λ, z = np.array([[latitude], [longitude], [altitude_m]], float)
    return ecef(φ, λ, z)[0]


# The scene ---------------------------------------------------------------------------


def cumulus(*, hard: bool, steps: int, nodes: int = NODES) -> Scene:
    """Low broken cloud without a mask, in one visible band."""
    ladders = (
        Ladder(Gaussian(), 25e3, 3.1e3),
        Ladder(Gaussian(), 3.9e3, 25.0),
        Ladder(InvertedWorley(), 5e3, 300.0),
    )
    function = {
        "weights": (1.0, 0.5, 0.5),
        "persistences": (0.5, 0.5, 0.7),
        "gains": np.ones(sum(len(ladder.octaves) for ladder in ladders)),
        "mask_gain": 1.0,
        "threshold": 0.5,
        "barrier_strength": 1.0,
        "base_m": 600.0,
        "top_m": 2500.0,
        "barrier_scale_m": 250.0,
        "smoothing": 1e-3,
    }
    cloud = (HardCloud if hard else FractalCloud)(
        function=CloudFunction(
            **{k: jnp.asarray(v, float) for k, v in function.items()}
        ),
        latent=Latent.equal_shares(1 if hard else nodes),
        shell=Shell(500.0, 4000.0),
        ladders=ladders,
        thickness_m=1900.0,
    )
    one = jnp.ones(1)
    layer = Layer(
        name="cumulus",
        cloud=cloud,
        extinction_per_m=jnp.asarray(3e-3),
        optics=GivenOptics(
            infrared_ratio=jnp.asarray(0.0),
            co_albedo=1e-6 * one,
            relative_absorption=jnp.zeros(0),
        ),
        steps=steps,
    )
    bands = ReflectiveBands((2,), one, path=0 * one, gain=one)
    reflection = TwoFlux(jnp.asarray(0.3))
    black = UniformGround(albedo=0.0)
    return Scene((layer,), bands, None, reflection, ground=black)


def sun_over(square: Square, azimuth_rad: float) -> np.ndarray:
    """Towards a sun 53 degrees from the vertical of the target."""
    vertical = square.target_m / np.linalg.norm(square.target_m)
    level = np.cross(vertical, [0.3, 0.2, 1.0])
    level /= np.linalg.norm(level)
    other = np.cross(vertical, level)
    azimuth = np.cos(azimuth_rad) * level + np.sin(azimuth_rad) * other
    return 0.6 * vertical + 0.8 * azimuth


def soft_rays(square: Square, sun: np.ndarray, parts: int = 1) -> np.ndarray:
    """Reflectances, the pixels' footprints averaged."""
    scene = cumulus(hard=False, steps=STEPS)
    seen = render(scene, square.rays(parts), sun)
    assert seen.radiances.reflective is not None
    return np.asarray(seen.radiances.reflective[0], float)


def hard_rays(
    square: Square, sun: np.ndarray, *, steps: int, parts: int = 1
) -> np.ndarray:
    """Reflectances of lines without a footprint."""
    scene, rays = cumulus(hard=True, steps=steps), square.rays(parts)
    textures = make_textures(scene)
    seen = []
    for start in range(0, len(rays), CHUNK):
        some = rays[start : start + CHUNK]
        ways = lay(scene, some, sun, Sampling(0.0, stretch=6.0))
        found = radiances(scene, sample(scene, ways, textures))
        assert found.reflective is not None
        seen.append(np.asarray(found.reflective[0], float))
    return np.concatenate(seen)


# The comparisons ---------------------------------------------------------------------


def gains(
    view: Callable[[int, int], Square], seeds: int, side: int = SIDE, parts: int = PARTS
) -> dict[str, float]:
    """Errors of soft rays and those of hard rays over them, over all seeds."""
    errors, mean = np.zeros((2, 3)), 0.0
    for seed in range(seeds):
        square = view(seed, side)
        sun = sun_over(square, 1.7 * seed)
        fine = hard_rays(square, sun, steps=square.truth_steps, parts=parts)
        truth = square.averaged(fine)
        hard = hard_rays(square, sun, steps=STEPS)
        soft = soft_rays(square, sun)
        errors += [_errors(found, truth) for found in (hard, soft)]
        mean += truth.mean()
    hard, soft = errors
    return {
        "bias": soft[0] / mean,
        "bias_hard": hard[0] / mean,
        "rmse_gain": float(np.sqrt(hard[1] / soft[1])),
        "w1_gain": hard[2] / soft[2],
    }


def _errors(found: np.ndarray, truth: np.ndarray) -> list[float]:
    """Bias, mean square, and the distance W1 of the distributions."""
    return [
        float(found.mean() - truth.mean()),
        float(((found - truth) ** 2).mean()),
        float(np.abs(np.sort(found) - np.sort(truth)).mean()),
    ]


def blocks(view: Callable[[int, int], Square], seeds: int, side: int, parts: int):
    """Block averages of a view from low orbit against the pixels of GEO.

    **Returns:** the difference of the means and the RMSE, over the mean of the blocks,
    which are those of low orbit; and the same of a mean of hard rays.
    """
    found, mean = np.zeros((2, 2)), 0.0
    for seed in range(seeds):
        high = view(seed, side)
        low, sun = from_low_orbit(high), sun_over(high, 1.7 * seed)
        block = low.averaged(soft_rays(low, sun, parts))
        pixel = soft_rays(high, sun)
        many = high.averaged(hard_rays(high, sun, steps=high.truth_steps, parts=PARTS))
        found += [_errors(x, block)[:2] for x in (pixel, many)]
        mean += block.mean()
    (bias, square), (bias_hard, square_hard) = found
    return {
        "mean": bias / mean,
        "rmse": float(np.sqrt(square * seeds)) / mean,
        "mean_of_64_hard_rays": bias_hard / mean,
        "rmse_of_64_hard_rays": float(np.sqrt(square_hard * seeds)) / mean,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/footprint"))
    parser.add_argument("--seeds", type=int, default=SEEDS)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    found = {"views": {}, "blocks": {}}
    for name, view in VIEWS.items():
        found["views"][name] = gains(view, options.seeds)
        print(name, found["views"][name], flush=True)
    for name in ("GEO nadir", "GEO near the limb"):
        # 100² rays of 20 m in a pixel of 2 km.
        found["blocks"][name] = blocks(VIEWS[name], seeds=2, side=12, parts=100)
        print(name, found["blocks"][name], flush=True)
    (options.output / "footprint.json").write_text(json.dumps(found, indent=2) + "\n")
    (options.output / "footprint.md").write_text(tables(found), encoding="utf-8")
    print(tables(found))


def tables(found: dict) -> str:
    views = [
        f"| {name} | {100 * v['bias']:+.1f} % | {100 * v['bias_hard']:+.1f} % "
        f"| {v['rmse_gain']:.2f} | {v['w1_gain']:.2f} |"
        for name, v in found["views"].items()
    ]
    same = [
        f"| {name} | {100 * v['mean']:+.1f} % | {100 * v['rmse']:.1f} % "
        f"| {100 * v['mean_of_64_hard_rays']:+.1f} % "
        f"| {100 * v['rmse_of_64_hard_rays']:.1f} % |"
        for name, v in found["blocks"].items()
    ]
    return "\n".join(
        [
            "| view | bias | bias of hard rays | RMSE gain | W1 gain |",
            "| --- | --: | --: | --: | --: |",
            *views,
            "",
            "| GEO against LEO blocks | mean | RMSE | mean of 64 hard rays | RMSE |",
            "| --- | --: | --: | --: | --: |",
            *same,
            "",
        ]
    )


if __name__ == "__main__":
    main()
