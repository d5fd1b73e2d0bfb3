"""Small scenes and lines of sight that many tests share."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from cloudjax import (
    AbstractCloudSource,
    AbstractGround,
    AbstractMask,
    BandRadiances,
    CloudFunction,
    DisplacementMap,
    EmissiveBands,
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
    StandardAtmosphere,
    TwoFlux,
    View,
    radiances,
)
from cloudjax.geometry.geodesy import ecef
from cloudjax.geometry.latlon_grid import LatLonGrid
from cloudjax.light.ground import ClearRadiances, GroundSamples, Leaving
from cloudjax.march import view as march_view


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
# Band: radiance at 300 K and at 220 K, mW m⁻² sr⁻¹ (cm⁻¹)⁻¹, from the coefficients.
BLACK_BODIES = {
    7: (0.90513, 0.010360),
    8: (21.67649, 1.316138),
    9: (35.39538, 2.866003),
    10: (43.75333, 4.057425),
    11: (67.83001, 8.591218),
    12: (91.85871, 14.880235),
    13: (105.09121, 19.285315),
    14: (118.51919, 24.693619),
    15: (131.92428, 31.381790),
    16: (141.06741, 37.149164),
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
    """Eq. (1) for a cloud between 1 and 3 km, with ladders of two rungs and of one."""
    values = {
        "weights": (1.0, 0.5),
        "persistences": (0.6, 0.7),
        "gains": (1.0, 1.1, 0.9),
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


CREASED = Ladder(InvertedWorley(), 12e3, 12e3)
# Without creases, for what is to converge as if CF were smooth.
SMOOTH = Ladder(Gaussian(), 9e3, 9e3)


def fractal_cloud(
    shell: Shell = LOW_SHELL,
    nodes: int = 1,
    second: Ladder = CREASED,
    **changes,
) -> FractalCloud:
    """A cloud of Gaussian and Worley noise in a shell."""
    return FractalCloud(
        function=cloud_function(**changes),
        latent=Latent.equal_shares(nodes),
        shell=shell,
        ladders=(Ladder(Gaussian(), 20e3, 10e3), second),
        seed=3,
    )


def layer(cloud: AbstractCloudSource, *, reflective=1, emissive=1, **changes) -> Layer:
    """A layer of nearly white cloud for so many bands."""
    own = {"name": "cloud", "steps": 12, "extinction_per_m": 0.002}
    own |= {key: changes.pop(key) for key in own if key in changes}
    own["extinction_per_m"] = jnp.asarray(own["extinction_per_m"], float)
    optics = {
        "infrared_ratio": 0.4,
        "co_albedo": np.full(reflective, 0.01),
        "relative_absorption": np.linspace(1, 1.2, emissive),
    } | changes
    arrays = {k: jnp.asarray(v, float) for k, v in optics.items()}
    return Layer(cloud=cloud, optics=GivenOptics(**arrays), **own)


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
    **fields,
) -> Scene:
    return Scene(
        layers=tuple(layers),
        reflective=reflective,
        emissive=emissive,
        reflection=TwoFlux(jnp.asarray(indirect, float)),
        temperature=temperature or StandardAtmosphere(),
        air=air,
        **fields,
    )


class FunctionMask(AbstractMask):
    """A mask from any function of latitude and longitude."""

    function: Callable = eqx.field(static=True)

    def __call__(self, latitude_deg, longitude_deg):
        return self.function(latitude_deg, longitude_deg)


class TurnedAir(DisplacementMap):
    """Solid air that came from further west; the wind of its grid is not read."""

    degrees: float = eqx.field(static=True)

    @classmethod
    def by(cls, degrees: float) -> "TurnedAir":
        grid = LatLonGrid.from_axes(np.array([-90.0, 90.0]), np.array([0.0, 180.0]))
        return cls(
            jnp.zeros((2, 2, 3)), numbers(0.0)[0], numbers(0.0)[0], grid, degrees
        )

    def displacement_of(self, points):
        c, s = np.cos(np.radians(self.degrees)), np.sin(np.radians(self.degrees))
        return points @ jnp.array([[c - 1, -s, 0], [s, c - 1, 0], [0, 0, 0]])


def under_weather(
    scene: Scene, masks: Sequence | None = None, displacements: Sequence | None = None
) -> Scene:
    """The scene with a mask for each layer, and maps for each of its textures.

    **Arguments:** `masks`: functions of latitude and longitude, or None.
    """
    none = [None] * len(scene.layers)
    layers = []
    for one, mask, maps in zip(
        scene.layers, masks or none, displacements or none, strict=True
    ):
        if mask is not None and not isinstance(mask, AbstractMask):
            mask = FunctionMask(mask)
        if mask is not None or maps is not None:
            cloud = dataclasses.replace(one.cloud, mask=mask, displacements=maps)
            one = dataclasses.replace(one, cloud=cloud)
        layers.append(one)
    return dataclasses.replace(scene, layers=tuple(layers))


class _BrightGround(AbstractGround):
    """Ground that is known by what leaves it at the top of the atmosphere."""

    under_air: ClassVar[bool] = False

    def seen(self, samples, reflective, emissive) -> Leaving:
        given: ClearRadiances = samples.properties
        reflected, emitted = given.reflective, given.emissive
        if reflected is not None:
            assert reflective is not None
            reflected = reflective.reflectance(reflected.T)
        return Leaving(reflected, None if emitted is None else emitted.T)


class GivenGround(_BrightGround):
    """Radiances without cloud of given rays, which must be laid in one piece."""

    radiances: BandRadiances

    def look(
        self, rays, places, hit, sun_direction, reflective, emissive
    ) -> GroundSamples:
        both = self.radiances.reflective, self.radiances.emissive
        given = ClearRadiances(*(None if x is None else x.T for x in both))
        return GroundSamples.of(places, hit, sun_direction, properties=given)


class PlacesGround(_BrightGround):
    """Radiances without cloud that tell every place from all others."""

    def look(
        self, rays, places, hit, sun_direction, reflective, emissive
    ) -> GroundSamples:
        ramp = (places.latitude_deg + places.longitude_deg / 7)[:, None] / 10

        def levels(bands, first):
            if bands is None:
                return None
            return jnp.asarray(first + ramp + np.arange(len(bands.numbers)), float)

        given = ClearRadiances(levels(reflective, 40.0), levels(emissive, 100.0))
        return GroundSamples.of(places, hit, sun_direction, properties=given)


def over(scene: Scene, background: BandRadiances) -> Scene:
    """The scene over radiances that are given for each ray."""
    return dataclasses.replace(scene, ground=GivenGround(background))


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


def lay_along(
    scene: Scene,
    rays: Rays,
    sun_direction: np.ndarray,
    masks: Sequence | None = None,
    displacements: Sequence | None = None,
    *,
    width_m: float = 0.0,
    knots: int = 2,
    twice: bool = False,
) -> march_view.Ways:
    """The ways of rays of one kind, whatever their pixels really are."""
    weathered = under_weather(scene, masks, displacements)
    some = with_pixels(rays, width_m)
    read = sampling(width_m, knots)
    return march_view.lay(weathered, some, sun_direction, read, twice=twice)


def view_along(
    scene: Scene,
    rays: Rays,
    sun_direction: np.ndarray,
    masks: Sequence | None = None,
    **options,
) -> View:
    """A view of rays of one kind; masks are laid and then forgotten.

    So scenes of different masks are compiled once: what is compiled knows no mask.
    """
    ways = lay_along(scene, rays, sun_direction, masks, **options)
    return march_view.sample(scene, ways, march_view.make_textures(scene))


def seen_along(
    scene: Scene,
    rays: Rays,
    sun_direction: np.ndarray,
    background: BandRadiances,
    masks: Sequence | None = None,
    **options,
) -> BandRadiances:
    """All parts of the renderer for a few rays over given radiances."""
    scene = over(scene, background)
    return radiances(scene, view_along(scene, rays, sun_direction, masks, **options))


def arrays(seen: BandRadiances) -> tuple[np.ndarray, np.ndarray]:
    """Reflective and emissive radiances of a scene that has both."""
    assert seen.reflective is not None
    assert seen.emissive is not None
    return np.asarray(seen.reflective), np.asarray(seen.emissive)


def with_pixels(rays: Rays, width_m: float) -> Rays:
    """The rays with pixels so wide at the distance of a geostationary satellite."""
    return dataclasses.replace(rays, pixel_rad=width_m / 3.6e7)


def sampling(width_m: float = 0.0, knots: int = 2) -> Sampling:
    """As often as noise can change along any ray whose pixels are so wide."""
    return Sampling(width_m, stretch=8.0, knots=knots, held_knots=knots)
