"""Displacement maps: a global grid carried upwind for 20 hours, beside numpy and scipy.

The peer does what `cloudjax.advection` does, in float64: Runge-Kutta of fourth order on
unit vectors in a wind whose Cartesian components are interpolated between the nodes.
"""

from collections.abc import Callable

import numpy as np
from scipy.ndimage import map_coordinates

from .sizes import Context
from .text import table
from .workers import Worker, in_turns, median_seconds


HOURS = 20.0
RADIUS_M = 6371e3 + 2000
# Between the two maps, in the mean: float32 in one of them.
SAME_M = 50.0


def run(context: Context) -> dict:
    sizes = context.sizes
    names = {"cloudjax": load_ours, "numpy and scipy": load_numpy}
    wind = make_wind()
    steps, degrees = sizes.map_steps, sizes.map_degrees
    context.log(f"displacement: {degrees} degrees, {HOURS:g} h in {steps} steps")
    workers = [Worker(make, wind, degrees, steps) for make in names.values()]
    first = [worker.run("map") for worker in workers]
    apart = np.linalg.norm(first[0][1] - first[1][1], axis=-1).mean() * RADIUS_M
    if apart > SAME_M:
        raise RuntimeError(f"The maps differ by {apart:.0f} m in the mean.")
    runs = in_turns([(worker, "map") for worker in workers], sizes.repeats)
    seconds = [median_seconds(results) for results in runs]
    peaks = [worker.close() for worker in workers]
    return {
        "degrees": degrees,
        "steps": steps,
        "apart_m": float(apart),
        "entries": [
            {"name": name, "seconds": s, "compile_seconds": cold - s, "peak_mb": peak}
            for name, s, (cold, _), peak in zip(
                names, seconds, first, peaks, strict=True
            )
        ],
        "ratio": seconds[1] / seconds[0],
    }


def make_wind() -> tuple[np.ndarray, ...]:
    """Latitudes, longitudes, and a westerly of two jets with waves, up to 50 m/s."""
    latitude, longitude = np.linspace(-90, 90, 73), np.arange(0, 360, 2.5)
    φ, λ = np.radians(latitude)[:, None], np.radians(longitude)[None]
    eastward = 40 * np.sin(2 * φ) ** 2 * (1 + 0.3 * np.sin(5 * λ)) - 8 * np.cos(φ) ** 4
    northward = 15 * np.sin(2 * φ) * np.cos(φ) * np.cos(5 * λ + 2 * φ)
    return latitude, longitude, eastward, northward


def load_ours(wind, degrees: float, steps: int) -> dict[str, Callable]:
    from cloudjax import Wind, displacement_map

    latitude, longitude, eastward, northward = wind
    air = Wind(eastward[None], northward[None], latitude, longitude, radius_m=RADIUS_M)

    def make():
        found = displacement_map(air, hours=HOURS, resolution_deg=degrees, steps=steps)
        return np.asarray(found.displacement)

    return {"map": make}


def load_numpy(wind, degrees: float, steps: int) -> dict[str, Callable]:
    latitude, longitude, eastward, northward = wind
    rows = round(180 / degrees)
    nodes = np.linspace(-90, 90, rows + 1), np.arange(2 * rows) * degrees - 180
    start = _vectors(*np.meshgrid(*nodes, indexing="ij"))
    velocity = _interpolator(latitude, longitude, eastward, northward)

    def make():
        p, step = start, -3600 * HOURS / steps
        for _ in range(steps):
            a = velocity(p)
            b = velocity(p + step / 2 * a)
            c = velocity(p + step / 2 * b)
            d = velocity(p + step * c)
            p = p + step / 6 * (a + 2 * b + 2 * c + d)
            p = p / np.linalg.norm(p, axis=-1, keepdims=True)
        return (p - start).astype(np.float32)

    return {"map": make}


def _vectors(latitude_deg, longitude_deg) -> np.ndarray:
    φ, λ = np.radians(latitude_deg), np.radians(longitude_deg)
    return np.stack([np.cos(φ) * np.cos(λ), np.cos(φ) * np.sin(λ), np.sin(φ)], axis=-1)


def _interpolator(latitude, longitude, eastward, northward) -> Callable:
    """The wind over the radius, tangent to the sphere, at points [... 3]."""
    φ, λ = np.meshgrid(np.radians(latitude), np.radians(longitude), indexing="ij")
    east = np.stack([-np.sin(λ), np.cos(λ), 0 * λ], axis=-1)
    north = np.stack([-np.sin(φ) * np.cos(λ), -np.sin(φ) * np.sin(λ), np.cos(φ)], -1)
    field = eastward[..., None] * east + northward[..., None] * north
    # A pole is one place.
    field[[0, -1]] = field[[0, -1]].mean(axis=1, keepdims=True)
    closed = np.concatenate([field, field[:, :1]], axis=1) / RADIUS_M
    components = [np.ascontiguousarray(closed[..., i]) for i in range(3)]
    step = latitude[1] - latitude[0], longitude[1] - longitude[0]

    def velocity(p):
        row = np.degrees(np.arctan2(p[..., 2], np.hypot(p[..., 0], p[..., 1]))) + 90
        column = np.degrees(np.arctan2(p[..., 1], p[..., 0])) % 360
        place = [row / step[0], column / step[1]]
        v = np.stack(
            [map_coordinates(c, place, order=1, mode="nearest") for c in components],
            axis=-1,
        )
        along = (v * p).sum(-1) / (p * p).sum(-1)
        return v - along[..., None] * p

    return velocity


def tables(found: dict) -> str:
    lines = [
        [
            e["name"],
            f"{e['seconds']:.2f}",
            f"{max(e['compile_seconds'], 0):.1f}",
            f"{e['peak_mb']:.0f}",
        ]
        for e in found["entries"]
    ]
    title = (
        f"### Displacement map of {found['degrees']}°, 20 h in {found['steps']} steps"
    )
    note = (
        f"{found['ratio']:.1f} times faster; the maps differ by "
        f"{found['apart_m']:.1f} m in the mean."
    )
    head = ["", "s", "compile s", "peak MB"]
    return "\n".join([title, "", table(head, lines), "", note, ""])
