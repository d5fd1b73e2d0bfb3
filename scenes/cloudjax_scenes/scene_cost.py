"""What each part of a scene's model costs, on this machine.

A part is timed by rendering some of the pixels with it and without. Where the time
allowed does not reach for that, its operations stand for its seconds.
"""

import functools as ft
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import jax
import numpy as np
from jaxtyping import Float

from cloudjax import FractalCloud, Latent, Layer, Rays, Scene, View, look, render
from cloudjax.geometry.footprint import grouped, kinds
from cloudjax.march.marched_way import shares_of_ways
from cloudjax.march.radiances import see
from cloudjax.march.shadows import Shades


@dataclass(frozen=True, eq=False)
class Part:
    """A `Part` is a part of the model.

    **Fields:**

    - `name`: of the part; `why`: it is used or not, in words.
    - `used`: whether anything of it is computed.
    - `without`: the scene that lacks it; None where it is not used, or where no scene
      is compared.
    - `seen`: makes the view of that scene from that of the whole.
    - `counted`: whether its work is among the operations of radiances; that of winds is
      done where rays are laid.
    """

    name: str
    why: str
    used: bool
    without: Scene | None = None
    seen: Callable[[View], View] = lambda view: view
    counted: bool = True


@dataclass(frozen=True)
class Cost:
    """A `Cost` is what a part costs.

    **Fields:**

    - `seconds`: for all pixels of the image, once compiled; None of a part that is not
      used, for which no scene is compared, or that was neither timed nor counted.
    - `timed`: whether they were measured; else operations stand for them.
    """

    seconds: float | None = None
    timed: bool = False


def parts_of(scene: Scene, rays: Rays, view: View) -> list[Part]:
    """List every part of the model, and tell whether a scene uses it.

    **Arguments:** `rays`: of the scene, and `view`: of the same.
    """
    return [
        *_layers(scene, view),
        _shadows(scene),
        *_air(scene),
        _glint(scene, view),
        _thermal_scattering(scene),
        _sunlight_in_band_7(scene),
        _wind(scene),
        _nodes(scene),
        _octaves(scene, rays),
    ]


def costs(
    scene: Scene,
    rays: Rays,
    sun_direction: Float[np.ndarray, "3"],
    *,
    pixels: int,
    budget_s: float = 60.0,
) -> Iterator[tuple[Part, Cost]]:
    """Yield the whole first, then each part with what it costs, as it is found.

    **Arguments:**

    - `rays`: some of the image's, drawn at random.
    - `pixels`: of the whole image, for which seconds are told.
    - `budget_s`: after which nothing more is timed, and operations stand for it.
    """
    end = time.perf_counter() + budget_s
    share = pixels / len(rays)

    def seconds(one: Scene) -> tuple[float, float]:
        first = _elapsed(lambda: render(one, rays, sun_direction, tile=len(rays)))
        again = [
            _elapsed(lambda: render(one, rays, sun_direction, tile=len(rays)))
            for _ in range(2)
        ]
        return min(again) * share, first

    whole, to_compile = seconds(scene)
    view = look(scene, rays, sun_direction)
    yield (
        Part("all of it", f"by {len(rays)} pixels of {pixels}", True),
        Cost(whole, True),
    )
    every = operations(scene, view)
    for part in parts_of(scene, rays, view):
        if part.without is None:
            yield part, Cost()
        elif end - time.perf_counter() > to_compile:
            yield part, Cost(max(whole - seconds(part.without)[0], 0.0), True)
        elif not part.counted:
            yield part, Cost()
        else:
            fewer = operations(part.without, part.seen(view))
            yield part, Cost(whole * (1 - fewer / every))


def _elapsed(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def operations(scene: Scene, view: View) -> float:
    """Count the operations of a scene's radiances as XLA gets them, uncompiled."""
    # A function of its own each time: what jax has kept of others may not be counted.
    lowered = jax.jit(lambda scene, view: see(scene, view)[0]).lower(scene, view)
    counted = lowered.cost_analysis() or {}
    return float(counted.get("flops", 0.0))


# Parts --------------------------------------------------------------------------------


def _fewer_clouds(scene: Scene, change: Callable[[Layer], Layer]) -> Scene:
    return replace(scene, layers=tuple(map(change, scene.layers)))


def _layers(scene: Scene, view: View) -> Iterator[Part]:
    shares = shares_of_ways(scene, view.samples, view.layer_of)
    for i, layer in enumerate(scene.layers):
        own = [x for x, k in zip(shares, view.layer_of, strict=True) if k == i]
        share = float((np.max(own, axis=0) > 0).mean())
        others = tuple(one for one in scene.layers if one is not layer)
        name = f"layer {layer.name}"
        if share == 0:
            yield Part(name, "nowhere in view: laid and sampled, not marched", True)
            continue
        why = f"likely on {share:.0%} of the pixels, and marched in their tiles"
        if not others:
            yield Part(name, why, True)
            continue
        without = replace(scene, layers=others)
        yield Part(name, why, True, without, ft.partial(_without_layer, i))


def _without_layer(i: int, view: View) -> View:
    kept = [k for k, layer in enumerate(view.layer_of) if layer != i]
    shades = view.shades
    if shades is not None:
        shades = Shades(
            tuple(_but(i, shades.ways[k]) for k in kept), _but(i, shades.ground)
        )
    return View(
        samples=tuple(view.samples[k] for k in kept),
        start_m=tuple(view.start_m[k] for k in kept),
        air_k=None if view.air_k is None else tuple(view.air_k[k] for k in kept),
        around=view.around,
        shades=shades,
        layer_of=tuple(view.layer_of[k] - (view.layer_of[k] > i) for k in kept),
    )


def _but(i: int, some: tuple) -> tuple:
    return (*some[:i], *some[i + 1 :])


def _shadows(scene: Scene) -> Part:
    if scene.shadows is None:
        return Part("shadows", "none are asked (--shadows)", False)
    if scene.reflective is None:
        return Part("shadows", "no band sees the sun", False)
    why = f"{scene.shadows.steps} steps towards the sun"
    without = replace(scene, shadows=None)
    return Part("shadows", why, True, without, lambda view: replace(view, shades=None))


def _air(scene: Scene) -> Iterator[Part]:
    bands, air = scene.bands, scene.air
    for name, field in (("gases", "absorbed"), ("Rayleigh", "scattered")):
        if air is None:
            yield Part(name, "the scene has no air", False)
            continue
        counted = [b for b in getattr(air, field) if b in bands]
        if not counted:
            yield Part(name, "too thin in every band", False)
            continue
        without = replace(scene, air=replace(air, **{field: ()}))
        yield Part(name, f"in bands {', '.join(map(str, counted))}", True, without)


def _glint(scene: Scene, view: View) -> Part:
    name = "glint"
    if scene.reflective is None:
        return Part(name, "no band sees the sun", False)
    ground = view.around.ground.properties
    if getattr(ground, "glint", None) is None:
        return Part(name, "the ground has none of its own", False)
    return Part(name, "where sea is seen by day", True)


def _thermal_scattering(scene: Scene) -> Part:
    name = "thermal scattering"
    if scene.emissive is None:
        return Part(name, "no band emits", False)
    if scene.emission is None:
        return Part(name, "clouds only absorb in this light", False)
    return Part(name, "clouds are slabs", True, replace(scene, emission=None))


def _sunlight_in_band_7(scene: Scene) -> Part:
    name = "sunlight in band 7"
    if scene.emissive is None or 7 not in scene.emissive.numbers:
        return Part(name, "band 7 is not asked", False)
    sunlit = () if scene.reflective is None else scene.reflective.numbers
    if 7 not in sunlit:
        return Part(name, "the sun is down", False)
    return Part(name, "by day", True)


def _wind(scene: Scene) -> Part:
    clouds = [la.cloud for la in scene.layers if isinstance(la.cloud, FractalCloud)]
    if not any(m for c in clouds for m in c.displacements or ()):
        return Part("wind", "no winds are given", False)

    def calm(layer: Layer) -> Layer:
        return replace(layer, cloud=replace(layer.cloud, displacements=None))

    without = _fewer_clouds(scene, calm)
    return Part("wind", "textures are drawn out", True, without, counted=False)


def _nodes(scene: Scene) -> Part:
    clouds = [la.cloud for la in scene.layers if isinstance(la.cloud, FractalCloud)]
    most = max((c.latent.nodes.shape[0] for c in clouds), default=1)
    if most == 1:
        return Part("sub-pixel nodes", "one is as good as none", False)

    def single(layer: Layer) -> Layer:
        one = Latent.equal_shares(1)
        return replace(layer, cloud=replace(layer.cloud, latent=one))

    why = f"{most} for what pixels do not resolve; without: 1"
    return Part("sub-pixel nodes", why, True, _fewer_clouds(scene, single))


def _octaves(scene: Scene, rays: Rays) -> Part:
    read = every = 0
    for layer in scene.layers:
        if isinstance(layer.cloud, FractalCloud):
            rows = kinds(rays, scene.shell, scene.shells)
            points = [
                layer.cloud.points(kind.sampling)
                for kind, _ in grouped(rows)
                if kind.knots
            ]
            every += len(layer.cloud.rungs)
            read += int(np.any(points, axis=0).sum()) if points else 0
    why = f"{read} of {every} rungs are read, the others are finer than pixels"
    return Part("octaves", why, read > 0)
