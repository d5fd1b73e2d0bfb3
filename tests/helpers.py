"""Small scenes and lines of sight that many tests share."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from cloudjax import (
    POINT,
    BandRadiances,
    CloudFunction,
    EmissiveBands,
    Footprint,
    FractalCloud,
    InvertedWorley,
    Latent,
    Layer,
    Perlin,
    Rays,
    ReflectiveBands,
    Scene,
    Shell,
    StandardAtmosphere,
    TwoFlux,
    navigate,
    radiances,
    sample,
)
from cloudjax.geometry.geodesy import ecef


GEOSTATIONARY_M = np.array([42164160.0, 0.0, 0.0])

# GOES-16 by band: solar irradiance W m⁻² µm⁻¹; fk1, fk2, bc1, bc2 of the ABI files.
SOLAR = {1: 2017.1648, 2: 1631.3351, 3: 957.0699, 5: 242.54037, 6: 76.8999}
PLANCK = {
    7: (202263.0, 3698.19, 0.43361, 0.99939),
    8: (50687.1, 2331.58, 1.55228, 0.99667),
    9: (35828.3, 2076.95, 0.34427, 0.99918),
    10: (30174.0, 1961.38, 0.05651, 0.99986),
    11: (19779.9, 1703.83, 0.18733, 0.99948),
    12: (13432.1, 1497.61, 0.09102, 0.99971),
    13: (10803.3, 1392.74, 0.0755, 0.99975),
    14: (8510.22, 1286.27, 0.22516, 0.9992),
    15: (6454.62, 1173.03, 0.21702, 0.99916),
    16: (5101.27, 1084.53, 0.06266, 0.99974),
}


def numbers(*values: float):
    """A device vector in the default float of the running JAX."""
    return jnp.asarray(values, float)


def rays_to(
    origin_m: np.ndarray, target_m: np.ndarray, pixel_rad: float = 5.6e-5
) -> Rays:
    """Rays from one origin, or one each, through ECEF targets [rays 3]."""
    way = target_m - origin_m
    direction = way / np.linalg.norm(way, axis=-1, keepdims=True)
    origin = np.array(np.broadcast_to(origin_m, direction.shape))
    return Rays(origin, direction, pixel_rad)


def ground_points(
    count: int, latitude_deg: float, longitude_deg: float, spread_deg: float, seed=0
) -> np.ndarray:
    """Random points of the ellipsoid around a place, ECEF."""
    spread = np.random.default_rng(seed).uniform(-1, 1, (2, count)) * spread_deg
    return ecef(latitude_deg + spread[0], longitude_deg + spread[1], np.zeros(count))


def geostationary_rays(count: int = 40, spread_deg: float = 2.0, seed=0) -> Rays:
    """Rays from a geostationary satellite to random points near 20 N 10 E."""
    return rays_to(GEOSTATIONARY_M, ground_points(count, 20, 10, spread_deg, seed))


def limb_rays(*altitudes_m: float) -> Rays:
    """Rays from far over longitude 0 that graze the equator at 90 E at altitudes."""
    y = 6378137.0 + np.array(altitudes_m)
    origin = np.stack([0 * y + 3e7, y, 0 * y], axis=-1)
    return Rays(origin, np.broadcast_to([-1.0, 0, 0], origin.shape), 5.6e-5)


def sun(zenith_deg: float, latitude_deg=20.0, longitude_deg=10.0) -> np.ndarray:
    """Towards the sun, from a place that sees it due west at a zenith angle."""
    φ, λ, θ = np.radians([latitude_deg, longitude_deg, zenith_deg])
    vertical = np.array([np.cos(φ) * np.cos(λ), np.cos(φ) * np.sin(λ), np.sin(φ)])
    west = np.array([np.sin(λ), -np.cos(λ), 0.0])
    return np.cos(θ) * vertical + np.sin(θ) * west


def cloud_function(**changes) -> CloudFunction:
    """Eq. (1) for a cloud between 1 and 3 km, with two textures."""
    values = {
        "weights": (1.0, 0.5),
        "mask_gain": 1.0,
        "threshold": 0.2,
        "barrier_strength": 1.0,
        "base_m": 1000.0,
        "top_m": 3000.0,
        "barrier_scale_m": 200.0,
        "smoothing": 0.1,
    } | changes
    return CloudFunction(**{k: jnp.asarray(v, float) for k, v in values.items()})


LOW_SHELL = Shell(500.0, 4000.0)


def fractal_cloud(shell: Shell = LOW_SHELL, nodes: int = 1, **changes) -> FractalCloud:
    """A cloud of Perlin and Worley noise in a shell."""
    return FractalCloud(
        function=cloud_function(**changes),
        latent=Latent.gauss_hermite(nodes),
        shell=shell,
        fractals=(Perlin(4, octaves=2), InvertedWorley(4)),
        length_scales_m=(40e3, 17e3),
        seed=3,
    )


def layer(cloud: FractalCloud, *, reflective=1, emissive=1, **changes) -> Layer:
    """A layer of nearly white cloud for so many bands."""
    values = {
        "extinction_per_m": 0.002,
        "infrared_ratio": 0.4,
        "co_albedo": np.full(reflective, 0.01),
        "relative_absorption": np.linspace(1, 1.2, emissive),
    } | {k: v for k, v in changes.items() if k not in ("name", "steps")}
    arrays = {k: jnp.asarray(v, float) for k, v in values.items()}
    name = changes.get("name", "cloud")
    return Layer(cloud=cloud, name=name, steps=changes.get("steps", 12), **arrays)


def reflective_bands(*bands: int, path=0.0, gain=1.0) -> ReflectiveBands:
    return ReflectiveBands(
        numbers=bands,
        reflectance_per_radiance=numbers(*(np.pi / SOLAR[b] for b in bands)),
        path=numbers(*(path for _ in bands)),
        gain=numbers(*(gain for _ in bands)),
    )


def emissive_bands(*bands: int, path=0.0, gain=1.0) -> EmissiveBands:
    columns = zip(*(PLANCK[b] for b in bands), strict=True)
    return EmissiveBands(
        bands,
        *(numbers(*column) for column in columns),
        path=numbers(*(path for _ in bands)),
        gain=numbers(*(gain for _ in bands)),
    )


def make_scene(
    layers: Sequence[Layer],
    reflective: ReflectiveBands | None = None,
    emissive: EmissiveBands | None = None,
    *,
    indirect: float = 0.2,
    temperature=None,
    air=None,
) -> Scene:
    return Scene(
        layers=tuple(layers),
        reflective=reflective,
        emissive=emissive,
        reflection=TwoFlux(jnp.asarray(indirect, float)),
        temperature=temperature or StandardAtmosphere(),
        air=air,
    )


def make_background(scene: Scene, rays: int, reflected=20.0, emitted=100.0):
    """A background that is the same everywhere but not in every band."""

    def field(bands, value):
        if bands is None:
            return None
        levels = value * (1 + 0.1 * np.arange(len(bands.numbers)))
        return jnp.asarray(np.repeat(levels[:, None], rays, axis=1), float)

    return BandRadiances(
        field(scene.reflective, reflected), field(scene.emissive, emitted)
    )


def make_textures(scene: Scene, footprint: Footprint = POINT, resolution: int = 16):
    return tuple(
        layer.cloud.make_textures(footprint, resolution) for layer in scene.layers
    )


def seen_along(
    scene: Scene,
    rays: Rays,
    sun_direction: np.ndarray,
    background: BandRadiances,
    masks: Sequence | None = None,
    *,
    footprint: Footprint = POINT,
    resolution: int = 16,
    **view,
) -> BandRadiances:
    """All three parts of the renderer for a few rays."""
    way = navigate(scene, rays, sun_direction, masks, **view)
    textures = make_textures(scene, footprint, resolution)
    return _radiances(scene, _sample(scene, way, textures), background)


_sample, _radiances = eqx.filter_jit(sample), eqx.filter_jit(radiances)


def arrays(seen: BandRadiances) -> tuple[np.ndarray, np.ndarray]:
    """Reflective and emissive radiances of a scene that has both."""
    assert seen.reflective is not None
    assert seen.emissive is not None
    return np.asarray(seen.reflective), np.asarray(seen.emissive)


def pixel(width_m: float, slant: float = 1.0) -> Footprint:
    """A pixel, longer along the first axis where seen aslant."""
    return Footprint(width_m, width_m / slant)
