"""What an analysis tells of its clouds, in order, and what Table 1 says."""

from dataclasses import replace

import numpy as np
import pytest

from cloudjax import MaskGrid, cloud_classes, cloud_fraction, weather_classes
from cloudjax_data import DataError, WeatherSeries
from cloudjax_scenes.weather_decision import (
    DECISIONS,
    AllEvidence,
    Table1,
    decision_named,
    evidence_of,
)
from cloudjax_scenes.weather_evidence import SkyEvidence
from cloudjax_scenes.weather_scene import World, open_world
from tests.unit.scenes.test_weather_scene import LATITUDE, SHAPE, analysis


SKY = {
    "cover_low": 30.0,
    "cover_middle": 20.0,
    "cover_high": 60.0,
    "cover_boundary": 15.0,
    "cover_convective": 50.0,
    "convective_top_pa": 12000.0,
    "tropopause_gpm": 16500.0,
}


def with_fields(cube, means=frozenset(), /, **fields):
    """The same analysis with fields that have no levels, or one on all levels."""
    data = cube.data
    for name, value in fields.items():
        like = data["r"] if name in ("tcc", "clwmr", "icmr") else data["r"][0]
        data = data.assign({name: (like.dims, np.full(like.shape, value, np.float32))})
    return replace(cube, data=data.drop_vars("level_0", errors="ignore"), means=means)


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return analysis(tmp_path_factory.mktemp("plain"), r=85.0)


def test_each_layer_falls_back_in_order(plain):
    steps = [
        (with_fields(plain, cover_low=30.0, tcc=40.0, clwmr=1e-4), "cover of low"),
        (with_fields(plain, tcc=40.0, clwmr=1e-4), "covers on pressure levels"),
        (with_fields(plain, clwmr=1e-4, icmr=1e-5), "cloud water and ice and humidity"),
        (with_fields(plain, clwmr=1e-4), "cloud water and humidity"),
        (plain, "relative humidity, vertical motion and stability"),
    ]
    found = [SkyEvidence.of(cube) for cube, _ in steps]
    for sky, (_, words) in zip(found, steps, strict=True):
        assert words in sky.said["low"]
    low = [float(sky.covers["low"].mean()) for sky in found]
    np.testing.assert_allclose(low[:2], [0.3, 0.4], atol=1e-6)
    # Water of 0.1 g/kg at 85 % and 290 K; then nothing rises and nothing is stable.
    assert 0.2 < low[3] < low[2] < 1
    assert low[4] == 0
    assert "covers on pressure levels" in found[0].said["middle"]
    assert found[4].covers["middle"] == pytest.approx(np.full(SHAPE, 0.0625), rel=1e-3)


def test_levels_below_the_ground_have_no_cloud(plain):
    """Cover on all levels, and ground at 6 km: only high cloud is above it."""
    sky = SkyEvidence.of(with_fields(plain, tcc=40.0, orog=6000.0))
    found = {layer: float(cover.max()) for layer, cover in sky.covers.items()}
    assert found == pytest.approx({"low": 0.0, "middle": 0.0, "high": 0.4})


def _at(cube, name, **values):
    """The same analysis with a field of its own on each level, 0 on the others."""
    of = [values.get(f"hpa_{int(hpa)}", 0.0) for hpa in cube.data["level"]]
    column = np.reshape(of, (-1, 1, 1)) * np.ones(SHAPE)
    field = cube.data[name].dims, column.astype(np.float32)
    return replace(cube, data=cube.data.assign({name: field}))


def test_ascent_is_upwards_and_of_its_own_level(plain):
    """Air that rises has a pressure that falls; at 850 hPa here it sinks."""
    cube = _at(plain, "w", hpa_850=0.5, hpa_700=-0.2, hpa_500=0.4)
    ascent = SkyEvidence.of(cube).quantities["ascent_pa_s"]
    np.testing.assert_allclose(ascent, 0.2, rtol=1e-6)


@pytest.mark.parametrize(
    ("cape", "omega", "cover"), [(2e3, -0.5, 0.3), (2e3, 0.5, 0.0), (0.0, -0.5, 0.04)]
)
def test_unstable_air_that_rises_convects(plain, cape, omega, cover):
    """Where the file tells of no convective cloud, by 2000 J/kg and 0.5 Pa/s."""
    cube = with_fields(_at(plain, "w", hpa_500=omega, hpa_700=-omega), cape=cape)
    sky = SkyEvidence.of(cube)
    found = sky.quantities["deep_convection"]
    assert found == pytest.approx(np.full(SHAPE, cover), abs=5e-3)
    assert "ascent at 500 hPa" in sky.said["deep_convection"]


def test_the_boundary_layer_has_the_cloud_of_the_moistest_level(plain):
    """Of the levels of low cloud, 1000 to 700 hPa, whatever is above them."""
    for moist, share in (("hpa_1000", 1.0), ("hpa_850", 1.0), ("hpa_700", 0.0)):
        humid = {"hpa_1000": 50.0, "hpa_850": 50.0, "hpa_700": 50.0} | {moist: 90.0}
        sky = SkyEvidence.of(_at(plain, "r", hpa_500=99.0, **humid))
        found = sky.quantities["boundary_layer_share"][np.abs(LATITUDE) <= 45]
        np.testing.assert_array_equal(found, share)


def test_a_mean_over_hours_is_said(plain):
    cube = with_fields(plain, frozenset({"cover_low"}), **SKY)
    words = dict(AllEvidence().words(cube))
    assert words["low cloud"].endswith("a mean over the hours before")
    assert not words["high cloud"].endswith("a mean over the hours before")
    assert words["tropopause"] == "the file's tropopause"


@pytest.mark.parametrize("classes", [weather_classes, cloud_classes])
def test_classes_make_the_cover_of_their_layer(plain, classes):
    """Whatever the classes: independent clouds of them cover what the file says."""
    known = classes()
    found = AllEvidence().fractions(with_fields(plain, **SKY), known)
    for layer, cover in {"low": 0.3, "middle": 0.2, "high": 0.6}.items():
        parts = [
            found[n] for n, one in known.items() if evidence_of(one).layer == layer
        ]
        assert 1 - np.prod([1 - p for p in parts], axis=0) == pytest.approx(
            np.full(SHAPE, cover), abs=2e-3
        )


def test_deep_convection_claims_its_cover_below_a_high_tropopause(plain):
    def of(**changes):
        cube = with_fields(plain, **SKY | changes)
        found = AllEvidence().fractions(cube, weather_classes())
        return {name: float(part.mean()) for name, part in found.items()}

    assert of()["cumulonimbus"] == pytest.approx(0.5, abs=0.01)
    assert of()["cirrus"] == pytest.approx(0.2, abs=0.01)
    # No more than the high cover; a shallow top is none of its; nor a low tropopause.
    assert of(cover_high=10.0)["cumulonimbus"] == pytest.approx(0.1, abs=0.01)
    assert of(convective_top_pa=80000.0)["cumulonimbus"] < 1e-3
    low = of(tropopause_gpm=10000.0)
    assert low["cumulonimbus"] < 1e-3
    assert low["cirrostratus"] == pytest.approx(0.6, abs=0.01)


def test_an_inversion_makes_stratocumulus(plain):
    def of(kelvin):
        data = plain.data
        warm = data["t"].where(data["level"] > 800, data["t"] + kelvin)
        cube = with_fields(replace(plain, data=data.assign(t=warm)), cover_low=40.0)
        return AllEvidence().fractions(cube, weather_classes())

    assert of(15.0)["stratocumulus"].mean() > 0.3
    assert of(15.0)["cumulus"].mean() < 0.05
    assert of(-10.0)["cumulus"].mean() > 0.3


def test_rising_air_makes_stratus(plain):
    """Where the boundary layer does not hold all of the low cloud."""

    def of(omega_pa_s, boundary=0.0):
        rising = replace(
            plain, data=plain.data.assign(w=0 * plain.data["w"] + omega_pa_s)
        )
        cube = with_fields(rising, cover_low=40.0, cover_boundary=boundary)
        return AllEvidence().fractions(cube, weather_classes())

    assert of(-0.2)["stratus"].mean() > 0.35
    assert of(0.2)["stratus"].mean() < 0.02
    assert of(-0.05, boundary=40.0)["stratus"].mean() < 0.2


def test_table_1_decides_by_its_conditions_alone(plain):
    """By its formula here, and the covers of the file change nothing."""
    classes = cloud_classes()
    cube = with_fields(plain, **SKY)
    made = World(WeatherSeries.of([cube]), classes, Table1())
    found = made.fractions[0]
    for name, one in classes.items():
        level = cube.at_altitude(float(one.conditions.sampling_altitude_m))
        expected = cloud_fraction(
            one.conditions,
            level["r"].to_numpy() / 100,
            level["t"].to_numpy(),
            level["w"].to_numpy(),
        )
        np.testing.assert_allclose(found[name], expected, rtol=1e-5)
        mask = made.decision.mask(one, 24)(
            made.decision.held(found[name], made_axes(cube))
        )
        stored = MaskGrid.from_fraction(expected, *made_axes(cube))
        places = np.array([10.0, -33.0]), np.array([3.0, 171.0])
        np.testing.assert_allclose(mask(*places), stored(*places), rtol=1e-4)


def made_axes(cube):
    return cube.data["latitude"].to_numpy(), cube.data["longitude"].to_numpy()


def test_the_decision_has_classes_of_its_own(plain):
    assert set(World(WeatherSeries.of([plain])).classes) == set(weather_classes())
    for name, classes in (("table1", cloud_classes()), ("evidence", weather_classes())):
        opened = open_world([plain.path], decision=name)
        assert opened.decision == DECISIONS[name]
        assert set(opened.classes) == set(classes)
    with pytest.raises(DataError, match="no decision 'paper'"):
        decision_named("paper")


def test_a_class_that_no_mask_moves_is_refused(plain):
    one = replace(cloud_classes()["cirrus"], mask_gain=0.0)
    with pytest.raises(DataError, match="mask_gain of 0"):
        AllEvidence().mask(one, 24)
