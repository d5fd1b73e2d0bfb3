"""The same pictures on the CPU and on the GPU: python benchmarks/devices.py [-o DIR]

Each device renders in a process of its own: the full disc of the paper's Table 3 by
several presets, once and prepared; a gradient of it; and, where the analysis is there,
a full disc of 10 km over weather with all classes. Tables tell the seconds of each, the
memory of the device, and how far the pictures are apart.
"""

import argparse
import json
import multiprocessing
import os
import statistics
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from parts.facts import GFS, data_folder, low_cloud_fraction, machine
from parts.text import table
from peers.problem import SUN, Problem


PRESETS = ((2, 1), (6, 3))
PIXELS, VOXELS, REPEATS = 1000, 256, 5
SENSOR, BANDS = "abi-fulldisk-10km", (2, 13)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("out/devices"))
    parser.add_argument("--pixels", type=int, default=PIXELS, help="per side")
    parser.add_argument("--devices", default="cpu,cuda", help="names that JAX knows")
    options = parser.parse_args()
    names = options.devices.split(",")
    try:
        found = {name: measured(name, options.pixels) for name in names}
    except RuntimeError as error:
        parser.error(f"{error}; choose of the devices of this machine by --devices")
    text = tables(found)
    options.output.mkdir(parents=True, exist_ok=True)
    seconds = {name: one["seconds"] for name, one in found.items()}
    (options.output / "devices.json").write_text(json.dumps(seconds, indent=1))
    (options.output / "devices.md").write_text(text, encoding="utf-8")
    print(text)


def measured(device: str, pixels: int) -> dict:
    """What a device took, and its pictures, in a process of its own."""
    # Read by JAX when the process imports it.
    os.environ["JAX_PLATFORMS"] = device if device == "cpu" else f"{device},cpu"
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_measure, (pixels,))


def _measure(pixels: int) -> dict:
    import jax

    seconds, images = {}, {}
    for name, work in _works(pixels):
        started = time.perf_counter()
        images[name] = work()
        cold = time.perf_counter() - started
        taken = []
        for _ in range(REPEATS):
            started = time.perf_counter()
            work()
            taken.append(time.perf_counter() - started)
        seconds[name] = {"first": cold, "again": statistics.median(taken)}
        print(f"{jax.default_backend()}: {name}: {seconds[name]}", flush=True)
    memory = jax.local_devices()[0].memory_stats() or {}
    return {
        "seconds": seconds,
        "images": images,
        "kind": jax.local_devices()[0].device_kind,
        "peak_mb": memory.get("peak_bytes_in_use", 0) / 1e6,
    }


def _works(pixels: int) -> Iterator[tuple[str, Callable[[], np.ndarray]]]:
    yield from _discs(pixels)
    folder = data_folder()
    if folder is not None and (files := sorted((folder / GFS).glob("*.grib2"))):
        yield f"{SENSOR} over weather, bands {BANDS}", _weather(files)


def _discs(pixels: int) -> Iterator[tuple[str, Callable[[], np.ndarray]]]:
    import jax
    import jax.numpy as jnp

    from cloudjax import look, prepare, radiances, render

    def seen(image) -> np.ndarray:
        return np.concatenate(jax.tree.leaves(image.radiances))

    fraction, _ = low_cloud_fraction(generated=False)
    problem = Problem(pixels, VOXELS, 25, fraction)
    rays = problem.grid().rays()
    for steps, nodes in PRESETS:
        scene = problem.scene(steps, nodes)
        name = f"disc {pixels}², {steps} steps, {nodes} nodes"
        yield f"{name}, once", lambda scene=scene: seen(render(scene, rays, SUN))
        prepared = prepare(scene, rays, SUN)
        yield (
            f"{name}, prepared",
            lambda scene=scene, prepared=prepared: seen(render(scene, prepared)),
        )
        del prepared
    some = rays[np.arange(0, len(rays), max(len(rays) // 65536, 1))]
    view = look(scene, some, SUN)

    @jax.jit
    def gradient(scene, view):
        def loss(scene):
            return sum(jnp.sum(x) for x in jax.tree.leaves(radiances(scene, view)))

        return jax.grad(loss, allow_int=True)(scene)

    def by_weights() -> np.ndarray:
        found = gradient(scene, view).layers[0].cloud.function
        return np.concatenate([np.ravel(found.weights), np.ravel(found.threshold)])

    yield f"gradient, {len(some)} rays, {steps} steps, {nodes} nodes", by_weights


def _weather(files: list[Path]) -> Callable[[], np.ndarray]:
    from cloudjax_scenes.sensor_image import render_sensor
    from cloudjax_scenes.sensors import read_sensor
    from cloudjax_scenes.weather_scene import open_world

    world = open_world([str(file) for file in files])
    sensor = read_sensor(SENSOR)
    bands = [sensor.bands[number] for number in BANDS]

    def work() -> np.ndarray:
        image = render_sensor(world, sensor, bands, world.series.cubes[0].valid_time)
        return np.stack([image.radiance[number] for number in BANDS])

    return work


def tables(found: dict) -> str:
    facts = [f"- {name}: {value}" for name, value in machine().items()]
    kinds = [
        f"- {name}: {one['kind']}, peak {one['peak_mb']:.0f} MB of its memory"
        for name, one in found.items()
    ]
    first = next(iter(found))
    head = ["", *(f"{name} {what}, s" for name in found for what in ("first", "again"))]
    head += [f"{name} apart from {first}" for name in [*found][1:]]
    lines = [
        [
            work,
            *(
                f"{one['seconds'][work][what]:.3f}"
                for one in found.values()
                for what in ("first", "again")
            ),
            *(
                _apart(found[name]["images"][work], found[first]["images"][work])
                for name in [*found][1:]
            ),
        ]
        for work in found[first]["seconds"]
    ]
    return "\n".join([*facts, *kinds, "", table(head, lines), ""])


def _apart(seen: np.ndarray, other: np.ndarray) -> str:
    """RMS and largest difference over the standard deviation."""
    both = np.isfinite(seen) & np.isfinite(other)
    apart = np.abs(seen - other)[both] / max(float(other[both].std()), 1e-30)
    return f"{np.sqrt((apart**2).mean()):.1e}, {apart.max():.1e}"


if __name__ == "__main__":
    main()
