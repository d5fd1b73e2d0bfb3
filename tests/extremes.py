"""The rows of docs/accuracy/extremes.md: what is extreme, and what happens there.

Each row is a function that looks, requires what physics says, and returns a sentence
with what it measured. The tests run them all; `python -m tools.make_extremes` writes
the table.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np

from cloudjax import (
    EmissiveBands,
    FixedGrid,
    Particles,
    PlaneParallel,
    Rays,
    Shell,
    StandardAtmosphere,
    bands_named,
    look,
    radiances,
    render,
)
from cloudjax.geometry.geodesy import MEAN_RADIUS_M, ecef
from cloudjax.light.optics import radius_limits_um
from cloudjax.weather.advection import Wind, displacement_map
from cloudjax_fit.histogram import Bins, cumulative, spline_histogram
from tests.extreme_scenes import Kind, Seen, seen_from, view_of
from tests.helpers import GEOSTATIONARY_M, limb_rays, rays_to, sun


SIMPLE = Kind()
COUNT = 64
# A band in sunlight and one in emission: W m-2 sr-1 um-1 and mW m-2 sr-1 (cm-1)-1.
SUNLIT, THERMAL = 0, 1
CLOUDY, CLEAR = 1e4, -1e4
# A thick, low deck with an even top.
DECK = {
    "base_m": 800.0,
    "top_m": 2500.0,
    "barrier_scale_m": 200.0,
    "extinction_per_m": 0.02,
    "extinction_growth": 0.0,
    "infrared_ratio": 0.5,
    "radius_um": 10.0,
    "absorption": 1.0,
    "offset_k": 0.0,
    "ground_k": 290.0,
    "emissivity": 0.98,
    "albedo": 0.1,
}


@dataclass(frozen=True)
class Row:
    """One line of the table.

    **Fields:** `slow`: whether it compiles a scene of its own.
    """

    group: str
    name: str
    run: Callable[[], str]
    slow: bool = False


ROWS: list[Row] = []


def row(group: str, name: str, *, slow: bool = False):
    def keep(run: Callable[[], str]) -> Callable[[], str]:
        ROWS.append(Row(group, name, run, slow))
        return run

    return keep


# Looking ------------------------------------------------------------------------------


def _near(latitude=20.0, longitude=10.0, pixel_rad=5.6e-5, spread=1.0) -> Rays:
    """From geostationary orbit above the longitude, around a place."""
    turn = np.radians(longitude)
    origin = np.linalg.norm(GEOSTATIONARY_M) * np.array([np.cos(turn), np.sin(turn), 0])
    offsets = np.random.default_rng(0).uniform(-spread, spread, (2, COUNT))
    φ = np.clip(latitude + offsets[0], -90, 90)
    return rays_to(origin, ecef(φ, longitude + offsets[1], np.zeros(COUNT)), pixel_rad)


def _seen(
    rays: Rays | None = None,
    zenith: float | np.ndarray = 40.0,
    mask: float = 0.0,
    kind: Kind = SIMPLE,
    displacements=None,
    at: Mapping[str, float] | None = None,
    **values: float,
) -> Seen:
    """Look, and require that all is finite, derivatives of both modes too.

    **Arguments:** `zenith`: of the sun, or where it is; `at`, `values`: of parameters.
    """
    direction = zenith if isinstance(zenith, np.ndarray) else sun(zenith)
    rays = _near() if rays is None else rays
    view = view_of(
        kind, rays, direction, lambda φ, λ: 0 * φ + mask, displacements=displacements
    )
    vector = kind.vector(**(DECK | dict(at or {}) | values))
    found = seen_from(kind, np.tile(vector, (len(rays), 1)), view)
    for name, part in zip(found._fields, found, strict=True):
        assert np.isfinite(part).all(), name
    assert found.radiance.min() > -1e-3
    assert found.through.min() >= 0
    assert found.through.max() <= 1 + 1e-6
    return found


def _mean(seen: Seen, band: int) -> float:
    return float(seen.radiance[:, band].mean())


def _black(kelvin: float) -> float:
    bands = EmissiveBands.of(bands_named(13))
    assert bands is not None
    return float(bands.planck(jnp.asarray([kelvin]))[0, 0])


def _kelvin(seen: Seen) -> float:
    bands = EmissiveBands.of(bands_named(13))
    assert bands is not None
    radiance = jnp.asarray(seen.radiance[:, THERMAL].mean(), float)
    return float(bands.brightness_temperature_k(radiance[None, None])[0, 0])


def _close(found: float, expected: float, part: float) -> None:
    assert abs(found - expected) <= part * abs(expected), (found, expected)


# Clouds -------------------------------------------------------------------------------


@row("Clouds", "Optical depth 0")
def no_depth() -> str:
    thin, clear = _seen(mask=CLOUDY, extinction_per_m=1e-30), _seen(mask=CLEAR)
    difference = np.abs(thin.radiance - clear.radiance).max()
    assert thin.depth.max() < 1e-20
    assert difference < 1e-4
    return f"The ground is seen; clear sky differs by {difference:.0e} at most."


@row("Clouds", "Optical depth of a million")
def huge_depth() -> str:
    huge = _seen(mask=CLOUDY, extinction_per_m=1e3)
    less = _seen(mask=CLOUDY, extinction_per_m=10.0)
    assert huge.depth.min() > 1e6
    change = abs(_mean(huge, SUNLIT) / _mean(less, SUNLIT) - 1)
    assert change < 0.01
    # No gain from more of it: derivatives are nothing beside the radiance.
    assert np.abs(huge.forward).max() < 10 * np.abs(huge.radiance).max()
    return (
        f"Depth {huge.depth.mean():.1e}: sunlight has saturated (a hundredth of "
        f"it changes {change:.1%}), {_kelvin(huge):.1f} K, derivatives finite."
    )


@row("Clouds", "Threshold of no width, pixels of no width")
def no_width() -> str:
    seen = _seen(_near(pixel_rad=1e-12), smoothing=0.0, mask=0.5)
    between = ((seen.cover > 0.02) & (seen.cover < 0.98)).mean()
    return (
        f"A hard level set, but for steps that it cuts: {between:.0%} of the "
        "pixels are partly cloudy. Derivatives are finite."
    )


@row("Clouds", "All clear")
def all_clear() -> str:
    seen = _seen(mask=CLEAR)
    assert seen.cover.max() == 0
    expected = 0.98 * _black(290.0)
    _close(_mean(seen, THERMAL), expected, 1e-5)
    return (
        f"The ground alone: {_kelvin(seen):.2f} K at an emissivity of 0.98 and 290 K."
    )


@row("Clouds", "All cloudy")
def all_cloudy() -> str:
    seen = _seen(mask=CLOUDY)
    assert seen.cover.min() > 0.99
    top = float(StandardAtmosphere()(jnp.asarray(12e3)))
    assert top < _kelvin(seen) < 290
    least = seen.cover.min()
    return f"No ground is seen: {_kelvin(seen):.1f} K, cover {least:.3f} or more."


# Views --------------------------------------------------------------------------------


@row("Rays", "That graze the Earth")
def grazing() -> str:
    seen = _seen(limb_rays(*np.linspace(-5e3, 11e3, COUNT)), mask=CLOUDY)
    assert seen.depth.max() > 0
    return f"Depth up to {seen.depth.max():.0f}; radiances and derivatives are finite."


@row("Rays", "That miss the Earth and all air")
def missing() -> str:
    seen = _seen(limb_rays(*np.linspace(2e4, 3e6, COUNT)), mask=CLOUDY)
    assert np.abs(seen.radiance).max() == 0
    assert np.abs(seen.reverse).max() == 0
    return "Space: radiances and derivatives are exactly 0."


@row("Rays", "That start inside cloud")
def inside() -> str:
    below = _near()
    inside = ecef(np.full(COUNT, 20.0), np.full(COUNT, 10.0), np.full(COUNT, 1600.0))
    rays = replace(below, origin_m=inside)
    seen = _seen(rays, mask=CLOUDY, extinction_per_m=1.0)
    air = float(StandardAtmosphere()(jnp.asarray(1600.0)))
    assert seen.depth.min() > 100
    # Within a step of where they start; cloud scatters a little of what it emits.
    assert abs(_kelvin(seen) - air) < 6
    return f"{_kelvin(seen):.1f} K: the cloud around, in air of {air:.1f} K."


def _at(zenith: float) -> tuple[float, Seen]:
    seen = _seen(_near(spread=0.1), zenith=_over(zenith), mask=CLOUDY)
    return _mean(seen, SUNLIT), seen


def _over(zenith: float) -> np.ndarray:
    """A sun at this distance from the zenith of 20 N 10 E."""
    φ, λ = np.radians([20.0, 10.0])
    up = np.array([np.cos(φ) * np.cos(λ), np.cos(φ) * np.sin(λ), np.sin(φ)])
    east = np.array([-np.sin(λ), np.cos(λ), 0])
    θ = np.radians(zenith)
    return np.cos(θ) * up + np.sin(θ) * east


@row("Sun", "Overhead")
def overhead() -> str:
    bright, _ = _at(0.0)
    low, _ = _at(60.0)
    assert bright > low > 0
    return f"{bright:.0f} W m⁻² sr⁻¹ µm⁻¹ in band 2; {low:.0f} with the sun at 30°."


@row("Sun", "At the horizon")
def horizon() -> str:
    (level, _), (above, _) = _at(90.0), _at(89.0)
    assert 0 <= level < above < 20
    return f"{level:.2f} W m⁻² sr⁻¹ µm⁻¹; {above:.2f} one degree higher: no jump."


@row("Sun", "Below the horizon, and behind the limb")
def night() -> str:
    for zenith in (95.0, 120.0, 180.0):
        dark, seen = _at(zenith)
        assert dark == 0
        assert _kelvin(seen) > 200
    return "No sunlight at all; emission is as by day. Derivatives are finite."


@row("Places", "Poles")
def poles() -> str:
    found = []
    for latitude in (90.0, -90.0):
        above = ecef(np.array([latitude]), np.array([0.0]), np.array([8e5]))
        φ = np.sign(latitude) * (90 - np.linspace(0, 1, COUNT))
        ground = ecef(φ, np.linspace(-180, 180, COUNT), np.zeros(COUNT))
        found.append(_seen(rays_to(above, ground), mask=0.5).cover.mean())
    return f"As elsewhere: mean cover {found[0]:.2f} and {found[1]:.2f}, all finite."


@row("Places", "The date line, and a satellite above it")
def date_line() -> str:
    covers = []
    for longitude in (179.999, -180.001, -179.999):
        seen = _seen(_near(0.0, longitude, spread=0.5), mask=0.0)
        covers.append(seen)
    # The same longitude, told in two ways.
    difference = np.abs(covers[0].radiance - covers[1].radiance).max()
    assert difference < 0.02
    grids = [FixedGrid.abi_meso(2.0, 0.0, λ, λ) for λ in (180.0, -180.0)]
    one, other = (grid.rays() for grid in grids)
    apart = np.abs(one.direction - other.direction).max()
    assert apart < 1e-12
    return (
        f"179.999° E and 180.001° W are one place (radiances differ by "
        f"{difference:.0e}), and ±180° are one satellite."
    )


# Weather ------------------------------------------------------------------------------


def _drawn_by(speed_m_s: float):
    """Solid air that turns with the Earth's axis, of a speed at the equator, 48 h."""
    φ, λ = np.linspace(-90, 90, 91), np.arange(0, 360, 2.0)
    eastward = speed_m_s * np.cos(np.radians(φ))[None, :, None] + np.zeros((1, 1, 180))
    wind = Wind(eastward, 0 * eastward, φ, λ, radius_m=MEAN_RADIUS_M)
    return displacement_map(wind, hours=48.0, resolution_deg=2.0)


@row("Winds", "0 m/s")
def calm() -> str:
    moved = np.asarray(_drawn_by(0.0).displacement)
    assert np.abs(moved).max() == 0
    return "Nothing is displaced, exactly."


@row("Winds", "150 m/s for 48 hours", slow=True)
def storm() -> str:
    drawn = _drawn_by(150.0)
    points = ecef(np.zeros(36), np.arange(0, 360, 10.0), np.zeros(36))
    points /= np.linalg.norm(points, axis=-1, keepdims=True)
    angle = 150 * 48 * 3600 / MEAN_RADIUS_M
    turned = np.stack(
        [
            points[:, 0] * np.cos(angle) + points[:, 1] * np.sin(angle),
            points[:, 1] * np.cos(angle) - points[:, 0] * np.sin(angle),
            points[:, 2],
        ],
        axis=-1,
    )
    off_km = np.linalg.norm(drawn.upwind(points) - turned, axis=-1).max() * 6371
    assert off_km < 10
    _seen(displacements=(drawn, drawn), mask=0.5)
    return (
        f"{angle * 6371:.0f} km round the Earth, {off_km:.1f} km off at a resolution "
        "of 2°; what is drawn by it is finite."
    )


# Shells -------------------------------------------------------------------------------


def _in_shell(bottom_m: float, top_m: float, **values: float) -> Seen:
    kind = replace(SIMPLE, shells=(Shell(bottom_m, top_m),))
    middle = {"base_m": bottom_m - 1e3, "top_m": top_m + 1e3}
    return _seen(kind=kind, mask=CLOUDY, at=middle | values)


@row("Shells", "10 m thick", slow=True)
def thin_shell() -> str:
    seen = _in_shell(3000.0, 3010.0, extinction_per_m=0.05)
    _close(float(seen.depth.mean()), 0.5, 0.01)
    return f"Depth {seen.depth.mean():.3f} where 10 m of 0.05 m⁻¹ make 0.5."


@row("Shells", "20 km thick", slow=True)
def thick_shell() -> str:
    seen = _in_shell(0.0, 20e3, extinction_per_m=1e-4)
    _close(float(seen.depth.mean()), 2.0, 0.02)
    return f"Depth {seen.depth.mean():.3f} where 20 km of 10⁻⁴ m⁻¹ make 2."


@row("Shells", "Touching the ground", slow=True)
def low_shell() -> str:
    seen = _in_shell(0.0, 500.0, extinction_per_m=0.1)
    air = float(StandardAtmosphere()(jnp.asarray(250.0)))
    assert abs(_kelvin(seen) - air) < 5
    return f"Fog of {_kelvin(seen):.1f} K in air of {air:.1f} K."


@row("Shells", "One inside another", slow=True)
def nested() -> str:
    kind = replace(SIMPLE, shells=(Shell(1e3, 9e3), Shell(4e3, 5e3)))
    open_shells = {"base_m": -1e3, "top_m": 13e3, "base_m_b": -1e3, "top_m_b": 13e3}
    depths = {"extinction_per_m": 1e-4, "extinction_per_m_b": 1e-3}
    growth = {"extinction_growth_b": 0.0}
    seen = _seen(kind=kind, mask=CLOUDY, at=open_shells | depths | growth)
    _close(float(seen.depth.mean()), 1.8, 0.02)
    return f"Depths add up: {seen.depth.mean():.3f}, where 0.8 and 1 make 1.8."


@row("Shells", "Top below base")
def upside_down() -> str:
    try:
        Shell(3000.0, 2000.0)
    except ValueError as error:
        sentence = str(error)
    else:
        raise AssertionError("a shell without air was accepted")
    seen = _seen(base_m=5000.0, top_m=2000.0, mask=0.5)
    assert seen.cover.max() < 1e-3
    return f"Shells are refused (“{sentence}”); barriers so leave no cloud."


# Textures and pixels ------------------------------------------------------------------


@row("Textures", "Wavelengths of 100 m and 5000 km", slow=True)
def waves() -> str:
    found = []
    for longest in (200.0, 5e6):
        kind = replace(SIMPLE, waves_m=(longest, longest / 2))
        found.append(_seen(kind=kind, mask=0.5))
    spread = [seen.cover.std() for seen in found]
    # Pixels of 2 km see nothing of the one, and no change within a few in the other.
    assert spread[1] < 0.35
    return (
        "Finite with their derivatives; cover within 2° varies by "
        f"{spread[0]:.2f} and {spread[1]:.2f}."
    )


@row("Pixels", "Of 1 m and of 100 km")
def pixel_sizes() -> str:
    spread = []
    for metres in (1.0, 1e5):
        seen = _seen(_near(pixel_rad=metres / 3.6e7), mask=0.0)
        spread.append(seen.cover.std())
    assert spread[1] < spread[0]
    return (
        f"Cover varies by {spread[0]:.2f} from pixel to pixel and by {spread[1]:.2f}: "
        "large pixels are averages."
    )


@row("Pixels", "One ray; images of prime size; tiles of any size", slow=True)
def shapes() -> str:
    scene, rays = SIMPLE.scene(SIMPLE.vector(**DECK), PlaneParallel.load()), _near()
    whole = radiances(scene, look(scene, rays[:37], sun(40.0)))
    image = render(scene, rays[:37], sun(40.0), tile=13).radiances
    one = radiances(scene, look(scene, rays[5:6], sun(40.0)))
    difference = 0.0
    for all_of_it, tiled, alone in zip(
        *map(jax.tree.leaves, (whole, image, one)), strict=True
    ):
        difference = max(difference, float(np.abs(tiled / all_of_it - 1).max()))
        difference = max(
            difference, float(np.abs(alone[:, 0] / all_of_it[:, 5] - 1).max())
        )
    assert difference < 2e-5
    return (
        f"The same radiances but for {difference:.0e} of them (37 rays, tiles of 13)."
    )


@row("Pixels", "One band", slow=True)
def one_band() -> str:
    seen, both = _seen(kind=replace(SIMPLE, thermal=())), _seen()
    np.testing.assert_allclose(seen.radiance[:, 0], both.radiance[:, 0], rtol=1e-4)
    return "Sunlight alone is what it is beside emission."


# Particles and radiances --------------------------------------------------------------


@row("Particles", "Radii at and beyond the ends of the tables")
def radii() -> str:
    limits = radius_limits_um("water")
    for outer, end in zip((1e-3, 1e4), limits, strict=True):
        both = [Particles("water", r).co_albedo_in([2, 5, 6]) for r in (outer, end)]
        np.testing.assert_allclose(*both, rtol=1e-5)
        _seen(mask=CLOUDY, radius_um=outer)
    return f"The ends hold: {limits[0]:g} and {limits[1]:g} µm for droplets."


@row("Radiances", "0, negative noise, saturation")
def odd_radiances() -> str:
    bands = EmissiveBands.of(bands_named(13))
    assert bands is not None
    values = jnp.asarray([[0.0, -0.5, 1e-10, 1e3]])
    kelvin = np.asarray(bands.brightness_temperature_k(values))[0]
    slopes = jax.grad(lambda x: bands.brightness_temperature_k(x).sum())(values)
    assert np.isfinite(kelvin).all()
    assert np.isfinite(np.asarray(slopes)).all()
    assert kelvin[0] == kelvin[1] == 0
    return (
        f"0 and less are 0 K, 10⁻¹⁰ is {kelvin[2]:.0f} K and 1000 is {kelvin[3]:.0f} K "
        "in band 13. Derivatives are finite."
    )


def _histogram(values, weights) -> np.ndarray:
    bins = Bins(0.0, 10.0, 8)

    def made(v):
        return cumulative(spline_histogram(v, jnp.asarray(weights, float), bins))

    values = jnp.asarray(values, float)
    for mode in (jax.jacfwd, jax.jacrev):
        assert np.isfinite(np.asarray(mode(made)(values))).all()
    return np.asarray(made(values))


@row("Histograms", "One distinct value")
def one_value() -> str:
    found = _histogram(np.full(50, 5.0), np.ones(50))
    _close(float(found[-1]), 1.0, 1e-6)
    return f"All weight in {int((np.diff(found, prepend=0) > 1e-6).sum())} of 8 bins."


@row("Histograms", "Empty bins, and no weight at all")
def empty_bins() -> str:
    assert not _histogram(np.full(50, 5.0), np.zeros(50)).any()
    found = _histogram([1.0, 9.0], [1.0, 1.0])
    assert (np.diff(found, prepend=0) == 0).any()
    return "Zeros, with derivatives of zero."


@row("Histograms", "One cloud pixel")
def one_pixel() -> str:
    found = _histogram([3.3], [1.0])
    _close(float(found[-1]), 1.0, 1e-6)
    return "It is shared by three bins, and its derivatives are finite."


# Numbers ------------------------------------------------------------------------------


@row("Numbers", "float32 and float64", slow=True)
def precision() -> str:
    single = _seen(mask=0.5)
    with jax.enable_x64(True):
        double = _seen(mask=0.5)
    assert double.radiance.dtype == np.float64
    values, slopes = (
        np.abs(getattr(single, name) - getattr(double, name)).max()
        / np.abs(getattr(double, name)).max()
        for name in ("radiance", "reverse")
    )
    assert values < 1e-4
    assert slopes < 1e-3
    return f"They differ by {values:.0e} of the largest; derivatives by {slopes:.0e}."


@row("Numbers", "1 and 5 sub-pixel nodes", slow=True)
def nodes() -> str:
    covers = [
        _seen(kind=replace(SIMPLE, nodes=n), mask=0.5).cover.mean() for n in (1, 3, 5)
    ]
    assert max(covers) - min(covers) < 0.1
    return (
        f"Mean cover is {covers[0]:.3f} and {covers[2]:.3f} ({covers[1]:.3f} of three)."
    )
