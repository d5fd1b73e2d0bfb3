"""An image beside its analysis: areas, covers, boxes and verdicts, by fields
whose answers are known.
"""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from cloudjax import FixedGrid
from cloudjax.geometry.geodesy import MEAN_RADIUS_M
from cloudjax_data import DataError, WeatherCube
from cloudjax_fit.validation.cold_tops import cold_tops
from cloudjax_fit.validation.cover import class_covers, compare_covers, seen_covers
from cloudjax_fit.validation.isccp import CLIMATOLOGY, TYPES, cloud_types
from cloudjax_fit.validation.requirements import requirements_of
from cloudjax_fit.validation.seen_earth import (
    MOST_STRETCH,
    SeenEarth,
    pixel_areas_m2,
)
from cloudjax_fit.validation.spectra import row_spectrum
from cloudjax_fit.validation.told_sky import (
    check_close,
    held_pixels,
    told_sky,
    top_pressures_hpa,
)


NOON = datetime(2019, 10, 27, 12, tzinfo=UTC)
LEVELS = np.array([1000.0, 700.0, 500.0, 250.0])
HEIGHTS = np.array([100.0, 3000.0, 5600.0, 10400.0])


def _cube(**covers) -> WeatherCube:
    """An analysis without weather but for covers [per cent]."""
    latitude, longitude = np.arange(-90.0, 91.0, 10.0), np.arange(0.0, 360.0, 10.0)
    shape = latitude.size, longitude.size
    levels = ("level", "latitude", "longitude")

    def column(values):
        return levels, np.broadcast_to(np.reshape(values, (-1, 1, 1)), (4, *shape))

    fields = {
        "gh": column(HEIGHTS),
        "t": column([290.0, 270.0, 255.0, 225.0]),
        **{name: column([0.0] * 4) for name in ("r", "u", "v", "w")},
        **{
            name: (levels[1:], np.broadcast_to(value, shape).astype(float))
            for name, value in covers.items()
        },
    }
    axes = {"level": LEVELS, "latitude": latitude, "longitude": longitude}
    return WeatherCube(xr.Dataset(fields, axes), NOON, Path("gfs.grib2"))


def _of_all_kinds(cover: np.ndarray) -> dict[str, np.ndarray]:
    return dict.fromkeys(("total", "high", "middle", "low"), cover)


def _places(step: float = 1.25):
    """Places all over the Earth and the areas that they stand for."""
    latitude = np.arange(-90 + step / 2, 90, step)
    longitude = np.arange(-180 + step / 2, 180, step)
    φ, λ = (x.ravel() for x in np.meshgrid(latitude, longitude, indexing="ij"))
    return φ, λ, (MEAN_RADIUS_M * np.radians(step)) ** 2 * np.cos(np.radians(φ))


# Areas ------------------------------------------------------------------------------


def test_pixels_of_a_grid_of_degrees_have_the_areas_of_a_sphere():
    """A cell of 1 degree is R² cos φ (π/180)² on a sphere; the ellipsoid differs from
    it by less than 1 %.
    """
    φ, λ = np.meshgrid(np.arange(60.0, 29.0, -1), np.arange(5.0, 25.0), indexing="ij")
    found = pixel_areas_m2(φ, λ)
    sphere = (MEAN_RADIUS_M * np.pi / 180) ** 2 * np.cos(np.radians(φ))
    np.testing.assert_allclose(found, sphere, rtol=0.01)


def _disc(pixels: int = 60) -> SeenEarth:
    angles = np.linspace(-0.15, 0.15, pixels)
    grid = FixedGrid(angles, -angles, -75.0)
    ground, hit = grid.rays().ground()
    φ, λ = (
        np.where(hit, x, np.nan).reshape(grid.shape)
        for x in (ground.latitude_deg, ground.longitude_deg)
    )
    flat = np.zeros(grid.shape)
    return SeenEarth("disc.nc", NOON, φ, λ, flat, flat, flat, {})


def test_the_limb_is_left_out_where_the_view_is_seventy_degrees_from_the_vertical():
    """From 35 786 km a view at 70 degrees meets the ground 61.8 degrees of the Earth
    from the sub-satellite point (law of sines), within a pixel (of 180 km there).
    """
    seen = _disc()
    away = np.degrees(
        np.arccos(
            np.cos(np.radians(seen.latitude_deg))
            * np.cos(np.radians(seen.longitude_deg + 75))
        )
    )
    inner = seen.counted & np.isfinite(away)
    assert np.nanmax(away[inner]) == pytest.approx(61.8, abs=1.7)
    assert seen.counted[np.nan_to_num(away, nan=90) < 59].all()
    assert pytest.approx(MOST_STRETCH, rel=0.01) == (39.556 / 35.786) ** 2 / 0.34202


# The analysis -----------------------------------------------------------------------


def test_lower_layers_of_an_analysis_are_seen_past_higher_ones():
    """Half of the sky under high cloud, half of the rest under middle cloud, and 80 %
    of what that leaves under low cloud: 50, 25 and 20 %, 95 in all.
    """
    cube = _cube(cover_low=80.0, cover_middle=50.0, cover_high=50.0)
    sky = told_sky(cube, np.array([0.0, 33.0]), np.array([-75.0, 170.0]))
    for kind, share in (("high", 0.5), ("middle", 0.25), ("low", 0.2), ("total", 0.95)):
        np.testing.assert_allclose(sky.seen[kind], share)
    assert "independent" in sky.total_words


def test_the_total_cover_of_the_file_comes_before_any_overlap():
    cube = _cube(cover_low=80.0, cover_middle=50.0, cover_high=50.0, cover_total=80.0)
    sky = told_sky(cube, np.zeros(1), np.zeros(1))
    np.testing.assert_allclose(sky.seen["total"], 0.8)
    np.testing.assert_allclose(sky.independent, 0.95)


def test_pressures_of_tops_are_those_of_the_analysis():
    """At its levels its own, halfway in height the geometric mean, below the lowest
    level by a scale height of 8 km, above the highest that of the standard atmosphere
    (55.3 hPa at 20 km); NaN without a top.
    """
    geometric = HEIGHTS / (1 - HEIGHTS / MEAN_RADIUS_M)
    halfway = geometric[1:3].mean()
    tops = np.array([*(geometric + 1e-3), halfway, geometric[0] - 80, 20e3, np.nan])
    found = top_pressures_hpa(_cube(), np.zeros(8), np.full(8, -75.0), tops)
    wanted = [*LEVELS[:3], None, np.sqrt(700 * 500), 1000 * np.exp(0.01), 55.3, np.nan]
    for value, known in zip(found, wanted, strict=True):
        if known is not None:
            assert value == pytest.approx(known, rel=1e-2, nan_ok=True)
    np.testing.assert_allclose(found[:3], LEVELS[:3], rtol=1e-5)
    assert found[4] == pytest.approx(np.sqrt(700 * 500), rel=1e-4)


def test_an_analysis_of_another_time_is_refused_unless_it_is_allowed():
    late = NOON + timedelta(minutes=31)
    with pytest.raises(DataError, match=r"31 minutes apart: .* --allow-mismatch\.$"):
        check_close(_cube(), "disc.nc", late, False)
    assert "clouds have moved" in check_close(_cube(), "disc.nc", late, True)
    assert check_close(_cube(), "disc.nc", NOON + timedelta(minutes=30), False) == ""


def test_an_analysis_of_less_than_half_of_the_image_is_refused():
    whole = _cube()
    region = WeatherCube(whole.data.isel(longitude=slice(0, 5)), NOON, whole.path)
    φ, λ = np.zeros(10), np.linspace(0.0, 90.0, 10)
    area = np.ones(10)
    with pytest.raises(DataError, match=r"gfs\.grib2 .* 50% of what disc|4\d% of what"):
        held_pixels(region, "disc.nc", φ, λ, np.where(λ < 45, 0.9, 1.0))
    assert held_pixels(region, "disc.nc", φ, λ, area).sum() == 5
    assert held_pixels(whole, "disc.nc", φ, λ, area).all()


# Cover ------------------------------------------------------------------------------


def _compared(image, told):
    φ, λ, area = _places()
    cover = told(φ, λ)
    kinds = _of_all_kinds(image(φ, λ)), _of_all_kinds(cover)
    return compare_covers(*kinds, cover, φ, λ, area)


def test_means_and_bands_are_weighted_by_area():
    """Cloud north of 30 degrees alone covers (1 - sin 30°)/2 of the Earth, a quarter,
    although half of a map of latitudes would be a third.
    """
    found = _compared(lambda φ, _: 1.0 * (φ > 30), lambda φ, _: 0.5 * (φ > 0))
    pair = found.whole["total"]
    assert (pair.image, pair.told) == pytest.approx((0.25, 0.25), abs=2e-3)
    assert pair.points == pytest.approx(0, abs=0.2)
    by = {b.south_deg: b for b in found.by_latitude}
    assert len(by) == 18
    assert by[30.0].covers["total"].points == pytest.approx(50)
    assert by[20.0].covers["total"].points == pytest.approx(-50)
    assert by[80.0].share == pytest.approx((1 - np.sin(np.radians(80))) / 2, rel=0.01)


def test_patterns_correlate_as_they_were_made_to():
    """Two waves of equal variance that share half of it correlate by a half; noise
    within boxes of 2.5 degrees is averaged away.
    """
    rng = np.random.default_rng(1)

    def wave(λ, number):
        return 0.2 * np.cos(np.radians(number * λ))

    # Opposite in the halves of each box.
    def image(φ, λ):
        noise = 0.3 * np.where(np.floor(λ / 1.25) % 2 == 0, 1, -1)
        return 0.5 + wave(λ, 3) + wave(λ, 5) + noise

    found = _compared(image, lambda φ, λ: 0.5 + wave(λ, 3) + wave(λ, 7))
    assert found.correlation["total"] == pytest.approx(0.5, abs=0.005)
    assert found.boxes == 144 * 72
    alone = _compared(lambda φ, λ: rng.random(φ.size), lambda φ, λ: wave(λ, 3))
    assert abs(alone.correlation["low"]) < 0.05


def test_boxes_of_which_little_is_seen_are_left_out():
    φ, λ, area = _places(0.5)
    near = (np.abs(φ) < 10) & (np.abs(λ) < 10)
    # A row of boxes of which a fifth is seen.
    near |= (np.abs(φ) < 10) & (λ > 10) & (λ < 10.5)
    kinds = _of_all_kinds(φ[near])
    found = compare_covers(kinds, kinds, φ[near], φ[near], λ[near], area[near])
    assert found.boxes == 64
    few = compare_covers(
        {k: v[:9] for k, v in kinds.items()},
        {k: v[:9] for k, v in kinds.items()},
        *(x[near][:9] for x in (φ, φ, λ, area)),
    )
    assert np.isnan(few.correlation["total"])


def test_layers_of_an_image_are_told_by_the_limits_of_the_analysis():
    """400 hPa is middle cloud at the equator, where that begins at 350, and high cloud
    at the pole, where it begins at 500; a pixel without a top has no layer.
    """
    latitude = np.array([0.0, 90.0, 0.0, 0.0])
    tops = np.array([400.0, 400.0, 700.0, np.nan])
    found = seen_covers(np.array([0.6, 0.7, 0.8, 0.04]), tops, latitude)
    np.testing.assert_allclose(found["high"], [0, 0.7, 0, 0])
    np.testing.assert_allclose(found["middle"], [0.6, 0, 0, 0])
    np.testing.assert_allclose(found["low"], [0, 0, 0.8, 0])
    np.testing.assert_allclose(found["total"], [0.6, 0.7, 0.8, 0.04])


def test_classes_cover_what_they_stop_the_light_of():
    found = class_covers(
        np.array([1.0, 0.5, 0.3]),
        np.array([2, 1, 0]),
        ("low", "high_ice"),
        np.array([1.0, 2.0, 1.0]),
    )
    assert found == pytest.approx({"low": 0.25, "high ice": 0.25})


# Types ------------------------------------------------------------------------------


def test_cloud_of_every_type_is_in_its_box():
    """One pixel of each type, half covered, by the depth of its cloudy half, and as
    much clear sky: each box has half of an eighteenth.
    """
    depths, tops = np.meshgrid([0.5, 5.0, 40.0], [300.0, 500.0, 900.0])
    fraction = np.array([0.5] * 9 + [0.0] * 9)
    clear = np.full(9, np.nan)
    found = cloud_types(
        fraction,
        np.concatenate([depths.ravel() / 2, np.zeros(9)]),
        np.concatenate([tops.ravel(), clear]),
        np.ones(18),
    )
    np.testing.assert_allclose(found.boxes, 100 * 0.5 / 18)
    np.testing.assert_allclose(found.fine.sum(), found.boxes.sum())
    names = [name for name, _, _ in found.rows()]
    assert names == [name for row in TYPES for name in row]
    assert names[2] == "deep convection"
    assert names[6] == "cumulus"


def test_types_count_by_area_and_what_is_too_thin_is_told_apart():
    found = cloud_types(
        np.ones(3),
        np.array([30.0, 0.2, 1e4]),
        np.array([200.0, 800.0, 5.0]),
        np.array([1.0, 1.0, 2.0]),
    )
    assert found.boxes[0, 2] == pytest.approx(75)
    assert found.boxes.sum() == pytest.approx(75)
    assert found.fine.sum() == pytest.approx(75)
    assert found.thin == pytest.approx(25)


def test_the_climatology_adds_up_to_what_is_known_of_the_globe():
    """ISCCP's mean cover is 68 % (abstracts and web pages); whole points may add up to
    four more or less.
    """
    assert np.sum(CLIMATOLOGY) == pytest.approx(68, abs=4)


# Tops and verdicts ------------------------------------------------------------------


def test_cold_tops_count_between_the_tropics_and_where_it_convects():
    kelvin = np.concatenate([np.linspace(201, 300, 100), [190.0, 210.0]])
    convection = np.concatenate([np.full(50, 0.5), np.zeros(52)])
    latitude = np.concatenate([np.zeros(100), [40.0, 10.0]])
    area = np.ones(102)
    found = cold_tops(13, kelvin, convection, latitude, area)
    assert found is not None
    # 201 to 214 and 210 of 101 pixels; the one at 40 degrees is outside.
    assert found.cold_share == pytest.approx(15 / 101)
    assert found.convects_share == pytest.approx(50 / 101)
    assert found.cold_where_convects == pytest.approx(14 / 50)
    assert found.coldest_where_convects_k == pytest.approx(203)
    assert found.coldest_k == 201
    assert cold_tops(13, kelvin, convection, np.full(102, 50.0), area) is None
    still = cold_tops(13, kelvin, np.zeros(102), latitude, area)
    assert still is not None
    assert np.isnan(still.coldest_where_convects_k)
    assert still.numbers()["coldest_where_convects_k"] is None


def test_targets_are_met_and_missed_by_their_numbers():
    φ, λ, area = _places()
    told = _of_all_kinds(0.5 + φ / 300)
    changes = {"low": 0.06, "middle": -0.04, "high": -0.06, "total": 0.0}
    image = {kind: told[kind] + change for kind, change in changes.items()}
    covers = compare_covers(image, told, told["total"], φ, λ, area)
    # A random walk has a slope of -2.
    steps = np.random.default_rng(7).standard_normal((40, 256))
    spectrum = row_spectrum(steps.cumsum(1), 10.0)
    assert spectrum is not None
    found = {t.what: t for t in requirements_of(covers, None, {"C13": spectrum})}
    verdicts = {
        next(k for k in ("low", "middle", "high", "total") if k in what): t.met
        for what, t in found.items()
        if "less analysis" in what
    }
    assert verdicts == {"low": False, "middle": True, "high": False, "total": True}
    anvils = next(t for what, t in found.items() if "convects" in what)
    assert anvils.met is None
    assert anvils.words.endswith("not told.")
    slope = next(t for what, t in found.items() if "C13" in what)
    assert slope.met
