"""The scene that a target is fitted with, and the parameters that may move.

Only what the target shows is built: no cirrus without a window band, no air and no
sunlight in bands that are not asked.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np

from cloudjax import (
    ICE,
    WATER,
    AbstractReflection,
    Air,
    BandRadiances,
    CloudFunction,
    EmissiveBands,
    EmittingSlabs,
    FractalCloud,
    InvertedWorley,
    Latent,
    LatLonGrid,
    Layer,
    MaskGrid,
    Particles,
    Perlin,
    PlaneParallel,
    Rays,
    ReflectiveBands,
    Scene,
    Slabs,
    StandardAtmosphere,
    TwoFlux,
    Weather,
)
from cloudjax.air.clear_air import rayleigh
from cloudjax.geometry.geodesy import up
from cloudjax_data import sun_direction
from cloudjax_scenes.surface import Surface
from cloudjax_scenes.weather_analysis import Analysis

from .first_guess import PUBLISHED, START, Start
from .parameters import Parameter
from .targets import BandTarget, Target


FRACTALS = (Perlin(8, 4), Perlin(8, 4), InvertedWorley(12))
# Periods without a common multiple, so that the sum repeats nowhere in an image.
LENGTH_SCALES_M = {
    "low_stratus": (410e3, 97e3, 173e3),
    "cirrus": (620e3, 139e3, 251e3),
}
PARTICLES = {"low_stratus": WATER, "cirrus": ICE}
REFERENCE_BAND = 13
# At most so much of a clear radiance at 3.9 µm is the sun's, or nothing would be warm.
MOST_SUN = 0.8


@dataclass(frozen=True)
class Light:
    """A strategy for light, and what extinction means to it.

    **Fields:**

    - `reflection`: makes the strategy for sunlight.
    - `share`: of the physical extinction that it calls extinction; absorption in the
      infrared is the physical one.
    - `emission`: makes the strategy for thermal radiation.
    - `air`: whether the air above the clouds is computed; else a path and a gain of
      each band, which are fitted, stand for it.
    - `start`: of each class.
    """

    reflection: Callable[[], AbstractReflection]
    share: float
    emission: Callable[[], EmittingSlabs | None] = lambda: None
    air: bool = False
    start: Mapping[str, Start] = field(default_factory=lambda: START)


LIGHTS = {
    # All extinction sends light back, which is (1 - g)/2 of it for g = 0.85
    # (docs/theory/paper.md).
    "paper": Light(lambda: TwoFlux(indirect=jnp.asarray(0.3)), (1 - 0.85) / 2),
    "physical": Light(
        lambda: Slabs(PlaneParallel.load()),
        1.0,
        lambda: EmittingSlabs(PlaneParallel.load()),
        air=True,
        start=PUBLISHED,
    ),
}


DEFAULT_LIGHT = "paper"


def light_of(scene: Scene) -> Light:
    """The strategy that a scene has been built for."""
    return LIGHTS["paper" if isinstance(scene.reflection, TwoFlux) else "physical"]


def build_scene(
    target: Target,
    analysis: Analysis | None = None,
    *,
    seed: int = 0,
    steps: int = 24,
    light: str = DEFAULT_LIGHT,
) -> Scene:
    """The scene that a target calls for, at the parameters' defaults.

    Temperatures and humidities are those of the analysis where there is one.
    """
    temperature, humidity = (
        (StandardAtmosphere(jnp.asarray(0.0)), None)
        if analysis is None
        else analysis.air(target)
    )
    strategy = LIGHTS[light]
    layers = tuple(
        _layer(name, target, seed + 100 * i, steps, strategy)
        for i, name in enumerate(target.fractions)
    )
    return Scene(
        layers=layers,
        reflective=_reflective_bands(target.sunlit, with_path=not strategy.air),
        emissive=_emissive_bands(target.emissive),
        reflection=strategy.reflection(),
        emission=strategy.emission() if target.emissive else None,
        temperature=temperature,
        air=Air.of_bands(tuple(target.bands), humidity) if strategy.air else None,
    )


def _layer(name: str, target: Target, seed: int, steps: int, light: Light) -> Layer:
    start, share = light.start[name], light.share
    particles: Particles = PARTICLES[name]
    sunlit = [b.number for b in target.sunlit]
    thermal = [b.number for b in target.emissive]
    function = CloudFunction(
        weights=jnp.asarray([1.0, 0.5, 0.5]),
        mask_gain=jnp.asarray(1.0),
        threshold=jnp.asarray(start.threshold),
        barrier_strength=jnp.asarray(1.0),
        base_m=jnp.asarray(start.base_m),
        top_m=jnp.asarray(start.top_m),
        barrier_scale_m=jnp.asarray(start.barrier_scale_m),
        smoothing=jnp.asarray(0.02),
    )
    return Layer(
        cloud=FractalCloud(
            function=function,
            latent=Latent.gauss_hermite(),
            shell=start.shell,
            fractals=FRACTALS,
            length_scales_m=LENGTH_SCALES_M[name],
            seed=seed,
        ),
        extinction_per_m=jnp.asarray(share * start.extinction_per_m),
        infrared_ratio=jnp.asarray(particles.infrared_ratio / share),
        co_albedo=particles.co_albedo_in(sunlit),
        asymmetry=particles.asymmetry_in(sunlit),
        relative_extinction=particles.relative_extinction_in(sunlit),
        relative_absorption=particles.relative_absorption_in(thermal),
        thermal_co_albedo=particles.thermal_co_albedo_in(thermal),
        thermal_asymmetry=particles.thermal_asymmetry_in(thermal),
        name=name,
        steps=steps,
    )


def _reflective_bands(
    bands: Sequence[BandTarget], *, with_path: bool
) -> ReflectiveBands | None:
    if not bands:
        return None
    path = [_path_reflectance(b) if with_path else 0.0 for b in bands]
    return ReflectiveBands(
        numbers=tuple(b.number for b in bands),
        reflectance_per_radiance=_stack([b.coefficients["kappa0"] for b in bands]),
        path=_stack(path),
        gain=jnp.ones(len(bands)),
    )


def _emissive_bands(bands: Sequence[BandTarget]) -> EmissiveBands | None:
    if not bands:
        return None
    planck = {
        name: _stack([b.coefficients[name] for b in bands])
        for name in ("fk1", "fk2", "bc1", "bc2")
    }
    return EmissiveBands(
        numbers=tuple(b.number for b in bands),
        **planck,
        path=jnp.zeros(len(bands)),
        gain=jnp.ones(len(bands)),
    )


def _path_reflectance(band: BandTarget) -> float:
    """Rayleigh scattering above low cloud, to first order: where its prior lies.

    Of the air above 850 hPa, phase function 3/4 (1 + cos²Θ) near backscatter, over the
    cosines of two 50 degree slants.
    """
    τ = float(rayleigh.optical_depth(band.wavelength_um))
    return 0.85 * τ * 1.5 / (4 * np.cos(np.radians(50)))


def _stack(numbers) -> jnp.ndarray:
    return jnp.asarray(np.array(numbers), float)


def scene_parameters(scene: Scene, target: Target) -> list[Parameter]:
    """Everything that may be fitted, with bounds and priors.

    The gauge of eq. (1) is fixed by holding the first weight and the strength of the
    barriers at 1 (see `cloudjax.cloud`): they are not listed.
    """
    parameters = []
    for i, layer in enumerate(scene.layers):
        start = light_of(scene).start[layer.name]
        parameters += _layer_parameters(i, layer, start, target)
    if scene.reflective is not None:
        if isinstance(scene.reflection, TwoFlux):
            parameters.append(
                Parameter(
                    "light.indirect",
                    lambda s: s.reflection.indirect,
                    0.3,
                    0.0,
                    1.0,
                    0.2,
                )
            )
        for i, band in enumerate(target.sunlit):
            path = float(scene.reflective.path[i])
            parameters += _reflective_air(i, band, path, scene.air is not None)
    if scene.emissive is not None:
        parameters.append(
            Parameter(
                "air.temperature_offset",
                lambda s: s.temperature.offset_k,
                0.0, -15.0, 15.0, 5.0, "K",
            )
        )  # fmt: skip
        for i, band in enumerate(target.emissive):
            parameters += _emissive_air(i, band, scene.air is not None)
    return parameters


def _layer_parameters(
    i: int, layer: Layer, start: Start, target: Target
) -> list[Parameter]:
    extinction = float(layer.extinction_per_m)
    low, high = start.top_bounds_m

    def of_function(name: str):
        return lambda scene: getattr(scene.layers[i].cloud.function, name)

    def of_layer(name: str):
        return lambda scene: getattr(scene.layers[i], name)

    rows = [
        ("weight_fine", of_function("weights"), 0.5, 0.0, 3.0, 0.4, "", 1),
        ("weight_worley", of_function("weights"), 0.5, 0.0, 3.0, 0.4, "", 2),
        ("mask_gain", of_function("mask_gain"), 1.0, 0.0, 4.0, 0.4),
        ("threshold", of_function("threshold"), start.threshold, -4.0, 4.0, 0.7),
        ("top", of_function("top_m"), start.top_m, low, high, start.top_spread_m, "m"),
        ("barrier_scale", of_function("barrier_scale_m"), start.barrier_scale_m,
         30.0, 2500.0, start.scale_spread, "m", None, True),
        ("extinction", of_layer("extinction_per_m"), extinction, 1e-6, 1.0,
         start.extinction_spread, "1/m", None, True),
    ]  # fmt: skip
    if target.emissive:
        ratio = float(layer.infrared_ratio)
        where = of_layer("infrared_ratio")
        rows.append(("infrared_ratio", where, ratio, start.infrared_least, 60.0,
                     start.infrared_spread, "", None, True))  # fmt: skip
    return [Parameter(f"{layer.name}.{name}", *rest) for name, *rest in rows]


def _reflective_air(
    i: int, band: BandTarget, path: float, known: bool
) -> list[Parameter]:
    """What is left of the air, and the calibration; less where the air is computed."""
    spread = (0.005, 0.05) if known else (0.01 + 0.5 * path, 0.1)
    if not band.reflective:
        return [
            Parameter(f"air.sun_gain_{band.name}", lambda s: s.reflective.gain, 1.0,
                      0.5, 1.5, spread[1], index=i),
        ]  # fmt: skip
    return [
        Parameter(f"air.path_{band.name}", lambda s: s.reflective.path, path, -0.1, 0.3,
                  spread[0], index=i),
        Parameter(f"air.gain_{band.name}", lambda s: s.reflective.gain, 1.0, 0.5, 1.5,
                  spread[1], index=i),
    ]  # fmt: skip


def _emissive_air(i: int, band: BandTarget, known: bool) -> list[Parameter]:
    return [
        Parameter(f"air.gain_{band.name}", lambda s: s.emissive.gain, 1.0, 0.7, 1.2,
                  0.01 if known else 0.03, index=i),
    ]  # fmt: skip


def weather_of(
    scene: Scene, target: Target, analysis: Analysis | None = None
) -> Weather:
    """Where a target's clouds may stand, and how the winds have drawn them."""
    masks = [
        MaskGrid.from_fraction(
            target.fractions[layer.name], target.latitude_deg, target.longitude_deg
        )
        for layer in scene.layers
    ]
    return Weather(masks, None if analysis is None else analysis.displacements(scene))


def background(target: Target, rays: Rays) -> BandRadiances:
    """What rays see without cloud.

    Clear pixels show what band 7 reflects and emits as one: by day the sun's part is
    that of the surface's table, and what is left is emission.
    """
    ground, _ = rays.ground(target.grid.ellipsoid)
    place = ground.latitude_deg, ground.longitude_deg
    grid = LatLonGrid.from_axes(target.latitude_deg, target.longitude_deg)
    maps = np.stack([band.background for band in target.bands.values()], axis=-1)
    seen = dict(zip(target.bands, np.asarray(grid.sample(maps, *place)).T, strict=True))
    sunlit = {
        band.number: seen[band.number]
        if band.reflective
        else _reflected(band, target.time, seen[band.number], *place)
        for band in target.sunlit
    }
    emitted = {
        band.number: seen[band.number] - sunlit.get(band.number, 0.0)
        for band in target.emissive
    }

    def rows(parts):
        return _stack(list(parts.values())) if parts else None

    return BandRadiances(rows(sunlit), rows(emitted))


def _reflected(band: BandTarget, time, seen, latitude_deg, longitude_deg):
    """The sun's part of a clear radiance, by the table of the surface."""
    vertical = up(latitude_deg, longitude_deg)
    height = np.maximum((vertical * sun_direction(time)).sum(-1), 0)
    (albedo,) = Surface().reflectance([band.number], latitude_deg, longitude_deg)
    reflected = albedo * height / band.coefficients["kappa0"]
    return np.minimum(reflected, MOST_SUN * seen)
