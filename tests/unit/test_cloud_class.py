"""Classes of cloud from data: the four of the paper, a fifth, and faulty ones."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import (
    InvertedWorley,
    Perlin,
    cloud_classes,
    fraction_to_mask,
    load_classes,
    make_texture,
)
from cloudjax.geometry.geodesy import ecef


FIFTH = """
[fog]
threshold = 0.1
mask_gain = 1.0
base_m = 20
top_m = 200
barrier_scale_m = 30
mask_displacement_hours = 0
extinction_per_m = 0.02
particles = "water"
effective_radius_um = 8

[fog.conditions]
sampling_altitude_m = 100
shell_bottom_m = 0
shell_top_m = 300
vertical_wind_min_pa_s = -inf
vertical_wind_max_pa_s = 0.05
temperature_min_k = 260
temperature_max_k = inf
critical_relative_humidity = 0.95
vertical_wind_width_pa_s = 0
temperature_width_k = 0.5

[[fog.textures]]
fractal = "perlin"
cells = 4
octaves = 3
persistence = 0.4
length_scale_m = 50e3
weight = 1
displacement_hours = 0

[[fog.textures]]
fractal = "inverted_worley"
cells = 8
length_scale_m = 19e3
weight = 0.5
displacement_hours = 1.5
"""


def load(folder, text: str):
    path = folder / "mine.toml"
    path.write_text(text)
    return load_classes(path)


def test_the_four_classes_have_a_cloud_within_their_shells():
    for name, cloud_class in cloud_classes().items():
        assert cloud_class.name == name
        shell = cloud_class.shell
        assert shell.bottom_m <= cloud_class.base_m < cloud_class.top_m <= shell.top_m
        for texture in cloud_class.textures:
            assert texture.displacement_hours <= 20
            # Two of the default 128 voxels for each of the finest cells.
            assert texture.fractal.finest_cells <= 64


def test_the_mask_gain_undoes_the_spread_of_the_textures():
    """Without barriers the level set then covers just the cloud fraction."""
    for cloud_class in cloud_classes().values():
        spread = math.hypot(*(t.weight for t in cloud_class.textures))
        assert cloud_class.mask_gain == pytest.approx(spread, abs=0.006)


@pytest.mark.parametrize("name", cloud_classes())
def test_a_class_covers_its_cloud_fraction(name):
    """Vertical columns all over the globe that hold cloud, by the cloud fraction.

    A column is covered by cloud at any altitude, and so sooner than one level is, and
    thresholds lift the scarce cover of Table 1, by up to 0.4 at a fraction of 0.3.
    Two octaves of noise, all standardised, do for four.
    """
    cloud = cloud_classes()[name].cloud(seed=0)
    rng, columns = np.random.default_rng(0), 1500
    latitude = np.degrees(np.arcsin(rng.uniform(-1, 1, columns)))
    longitude = rng.uniform(-180, 180, columns)
    altitude = np.linspace(cloud.shell.bottom_m, cloud.shell.top_m, 16)
    where = [ecef(latitude, longitude, np.full(columns, z)) for z in altitude]
    position = np.stack(where, axis=-1).transpose(1, 0, 2)
    values = tuple(
        make_texture(
            Perlin(fractal.cells, octaves=2)
            if isinstance(fractal, Perlin)
            else fractal,
            seed=i,
            resolution=32,
        ).sample(jnp.asarray(position / scale % 1, float))
        for i, (fractal, scale) in enumerate(
            zip(cloud.fractals, cloud.length_scales_m, strict=True)
        )
    )
    z = jnp.broadcast_to(jnp.asarray(altitude, float), (columns, 16))
    covers = []
    for fraction in (0.01, 0.3, 0.6, 0.99):
        mask = jnp.full((columns, 16), fraction_to_mask(jnp.asarray(fraction)))
        fractal = cloud.function.fractal(values)
        inside = cloud.function(fractal, mask, z) > 0
        covers.append(float(inside.any(axis=1).mean()))
    assert covers[0] < 0.15
    assert 0.25 < covers[1] < 0.7
    assert covers[1] + 0.1 < covers[2] < covers[3]
    assert covers[3] > 0.97


def test_extinctions_are_those_of_water_contents_and_radii():
    """3/2 LWC/(ρ r): the paper's section 2.4, extinction efficiency 2."""
    expected = {
        "low_stratus": (0.35, 1e6),
        "low_cumulus": (0.3, 1e6),
        "altostratus": (0.05, 0.917e6),
        "cirrus": (0.01, 0.917e6),
    }
    for name, (content_g_m3, density_g_m3) in expected.items():
        c = cloud_classes()[name]
        assert c.particles == ("water" if density_g_m3 == 1e6 else "ice")
        extinction = 1.5 * content_g_m3 / (density_g_m3 * c.effective_radius_um * 1e-6)
        assert c.extinction_per_m == pytest.approx(extinction, rel=0.02)


def test_a_fifth_class_is_read_from_a_file(tmp_path):
    fog = load(tmp_path, FIFTH)["fog"]
    assert fog.conditions.shell_top_m == 300
    assert fog.particles == "water"
    assert fog.textures[0].fractal == Perlin(4, octaves=3, persistence=0.4)
    assert fog.textures[1].fractal == InvertedWorley(8)
    assert fog.textures[1].displacement_hours == 1.5


def test_a_class_makes_its_cloud(tmp_path):
    cloud = load(tmp_path, FIFTH)["fog"].cloud(seed=7)
    # Marched no further than the barriers leave it a chance, within its shell.
    assert 200 < cloud.shell.top_m < 300
    assert cloud.shell.bottom_m == load(tmp_path, FIFTH)["fog"].shell.bottom_m
    assert cloud.length_scales_m == (50e3, 19e3)
    f = cloud.function
    assert f.weights.tolist() == [1.0, 0.5]
    altitude = jnp.asarray([[20.0, 110.0, 200.0]])
    still = jnp.zeros((1, 3))
    value = f(still, jnp.ones((1, 3)), altitude)[0]
    # Half of a barrier's strength is lost where it stands, e^-3 of each in the middle.
    assert value[1] == pytest.approx(0.9 - 2 * math.exp(-3), abs=1e-5)
    assert value[0] == pytest.approx(0.9 - 1 - math.exp(-6), abs=1e-5)
    assert value[2] == pytest.approx(float(value[0]), abs=1e-5)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[fog]", "[fog]\ncolour = 1", r"class fog has unknown key\(s\) colour"),
        ("threshold = 0.1", "", r"class fog lacks the key\(s\) threshold"),
        ("shell_top_m = 300", "", r"fog, conditions lacks the key\(s\) shell_top_m"),
        ("= 300", "= 'high'", "class fog, conditions: shell_top_m must be a number"),
        ("= 0.95", "= 95", "class fog, conditions: critical_relative_humidity"),
        ("top_m = 200", "top_m = 10", "class fog: base_m must be less than top_m"),
        ("= 0.02", "= 0", "class fog: extinction_per_m must be positive"),
        ("= 0.02", "= nan", "class fog: extinction_per_m must be positive"),
        ('"water"', '"snow"', "class fog: particles must be"),
        ('"water"', "3", "class fog: particles must be"),
        ('"perlin"', '"simplex"', "class fog, texture 1: must be a table with fractal"),
        ("cells = 8", "cells = 8.5", "texture 2: cells must be a whole number"),
        ("cells = 8", "octaves = 8", r"texture 2 has unknown key\(s\) octaves"),
        ("= 19e3", "= 0", "class fog, texture 2: length_scale_m of a texture"),
        ("= 1.5", "= -1", "class fog, texture 2: displacement_hours of a texture"),
        ("weight = 1\n", "weight = 2\n", "must begin with one of weight 1"),
        ("[[fog.textures]]", "[fog.texture]", "not valid TOML"),
        ("[fog]", "[fog", "not valid TOML"),
        (FIFTH, "fog = 1", "class fog must be a table"),
    ],
)
def test_a_faulty_file_is_refused_by_a_sentence(tmp_path, old, new, message):
    assert old in FIFTH
    with pytest.raises(ValueError, match=message) as caught:
        load(tmp_path, FIFTH.replace(old, new))
    assert str(caught.value).count("mine.toml") == 1
    assert str(caught.value).endswith(".")
