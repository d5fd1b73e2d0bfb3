"""Classes of cloud from data: the four of the paper, a fifth, and faulty ones."""

import dataclasses
import math
import re
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
import tomli_w

from cloudjax import (
    InvertedWorley,
    Ladder,
    Perlin,
    Prior,
    class_layer,
    class_table,
    cloud_classes,
    fraction_to_mask,
    imagery_classes,
    load_classes,
)
from cloudjax.geometry.geodesy import ecef
from tests.hard_reference import fractal_at


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
noise = "perlin"
longest_m = 12e3
shortest_m = 3e3
weight = 1
persistence = 0.4
displacement_hours = 0

[[fog.textures]]
noise = "inverted_worley"
longest_m = 19e3
shortest_m = 400
weight = 0.5
persistence = 0.8
displacement_hours = 1.5
"""


_PRIOR = "{} = {{ lower = 1, upper = 9, spread = 2 }}"


def _added(table: str, line: str) -> tuple[str, str]:
    """What to replace in the fifth class, and by what, for a table more."""
    return "[fog.conditions]", f"[fog.{table}]\n{line}\n[fog.conditions]"


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
    """
    cloud = cloud_classes()[name].cloud(seed=0)
    rng, columns = np.random.default_rng(0), 1500
    latitude = np.degrees(np.arcsin(rng.uniform(-1, 1, columns)))
    longitude = rng.uniform(-180, 180, columns)
    altitude = np.linspace(cloud.shell.bottom_m, cloud.shell.top_m, 16)
    where = [ecef(latitude, longitude, np.full(columns, z)) for z in altitude]
    fractal = jnp.asarray(fractal_at(cloud, np.stack(where, axis=1)), float)
    z = jnp.broadcast_to(jnp.asarray(altitude, float), (columns, 16))
    covers = []
    for fraction in (0.01, 0.3, 0.6, 0.99):
        mask = jnp.full((columns, 16), fraction_to_mask(jnp.asarray(fraction)))
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
    first, second = fog.textures
    assert first.ladder == Ladder(Perlin(), 12e3, 3e3)
    assert first.persistence == 0.4
    assert second.ladder == Ladder(InvertedWorley(), 19e3, 400.0)
    assert second.displacement_hours == 1.5
    assert second.gain_of_rungs == (1.0, 1.0, 1.0)


def test_a_class_makes_its_cloud(tmp_path):
    cloud = load(tmp_path, FIFTH)["fog"].cloud(seed=7)
    # Marched no further than the barriers leave it a chance, within its shell.
    assert 200 < cloud.shell.top_m < 300
    assert cloud.shell.bottom_m == load(tmp_path, FIFTH)["fog"].shell.bottom_m
    assert [rung.wavelength_m for rung in cloud.rungs if rung.band == 0] == [
        *(12e3, 6e3, 3e3),
        *(19e3, 4750, 1187.5),
    ]
    f = cloud.function
    assert f.persistences.tolist() == pytest.approx([0.4, 0.8])
    assert f.gains.tolist() == [1.0] * 6
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
        ("[fog]", "[fog]\ncolour = 1", "class fog has an unknown key, 'colour'"),
        ("threshold = 0.1", "", "class fog has no threshold: add"),
        ("shell_top_m = 300", "", "fog, conditions has no shell_top_m"),
        (
            "= 300",
            "= 'high'",
            "class fog, conditions gives shell_top_m = 'high': make it a number",
        ),
        ("= 0.95", "= 95", "class fog, conditions: critical_relative_humidity"),
        ("top_m = 200", "top_m = inf", "class fog gives top_m = inf: make it a finite"),
        ("= 0.02", "= 0", "class fog: extinction_per_m must be positive"),
        ("= 0.02", "= nan", "class fog gives extinction_per_m = nan: make it a finite"),
        (
            '"water"',
            '"snow"',
            'class fog gives particles = .*: make it "water" or "ice"',
        ),
        ('"water"', "3", 'class fog gives particles = .*: make it "water" or "ice"'),
        (
            '"perlin"',
            '"simplex"',
            'fog, texture 1: noise must be "gaussian" or "perlin"',
        ),
        ("persistence = 0.8", "", "class fog, texture 2 has no persistence: add"),
        ("persistence = 0.8", "cells = 8", "texture 2 has an unknown key, 'cells'"),
        ("= 0.8", "= 0", "class fog, texture 2: persistence of a texture must"),
        ("= 19e3", "= 100", "class fog, texture 2: shortest_m must be 1 or more and"),
        ("= 0.8", "= 0.8\ngains = [1]", "gains of a texture are 1 for 3 rungs"),
        ("= 0.8", "= 0.8\ngains = 1", "gives gains = 1: make it a list of finite"),
        ("= 1.5", "= 1e31", "displacement_hours = .*a finite number, within 1e30"),
        ("= 1.5", "= -1", "class fog, texture 2: displacement_hours of a texture"),
        ("weight = 1\n", "weight = 2\n", "must begin with one of weight 1"),
        ("[[fog.textures]]", "[fog.texture]", "not valid TOML"),
        ("[fog]", "[fog", "not valid TOML"),
        (*_added("imagery", "colder = 3"), "fog, imagery has an unknown key, 'colder'"),
        (*_added("priors", "top_m = 3"), "prior of top_m must be a table"),
        (*_added("priors", "top_m = {lower = 1, upper = 9}"), "has no spread"),
        (*_added("priors", _PRIOR.format("top")), "priors has an unknown key, 'top'"),
        (
            *_added("priors", _PRIOR.format("top_m").replace("9", "1")),
            "prior of top_m: lower must be less than upper",
        ),
        (FIFTH, "fog = 1", "class fog must be a table"),
    ],
)
def test_a_faulty_file_is_refused_by_a_sentence(tmp_path, old, new, message):
    assert old in FIFTH
    with pytest.raises(ValueError, match=message) as caught:
        load(tmp_path, FIFTH.replace(old, new))
    assert str(caught.value).count("mine.toml") == 1
    assert str(caught.value).endswith(".")


def test_a_file_without_a_class_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"mine\.toml holds no class of cloud"):
        load(tmp_path, "[air]\ngain_C13 = 1.0\n")
    with pytest.raises(ValueError, match=r"mine\.toml is not a file"):
        load_classes(tmp_path / "no" / "mine.toml")


@pytest.mark.parametrize(
    "classes",
    [cloud_classes(), imagery_classes(), imagery_classes(paper_light=True)],
    ids=["table 1", "physical", "paper"],
)
def test_classes_come_back_from_a_file(tmp_path, classes):
    classes = {name: _with_gains(one) for name, one in classes.items()}
    text = tomli_w.dumps({name: class_table(one) for name, one in classes.items()})
    back = load(tmp_path, text)
    assert list(back) == list(classes)
    assert back == classes


def _with_gains(one):
    first, *rest = one.textures
    gains = tuple(1 + 0.1 * i for i in range(len(first.gain_of_rungs)))
    return dataclasses.replace(
        one, textures=(dataclasses.replace(first, gains=gains), *rest)
    )


def test_parameters_have_usual_bounds_unless_the_file_gives_them(tmp_path):
    usual = {p.name: p for p in load(tmp_path, FIFTH)["fog"].parameters}
    assert list(usual) == [
        "weight_2",
        "mask_gain",
        "threshold",
        "top",
        "barrier_scale",
        "extinction",
        "radius",
        "depth_response",
        "top_response",
        "roughness_response",
    ]
    assert usual["threshold"].default == 0.1
    assert usual["threshold"].prior == Prior(-4.0, 4.0, 0.7)
    # As far as a scale beyond the shell.
    assert usual["top"].prior == Prior(-30.0, 330.0, 1000.0)
    assert usual["top"].unit == "m"
    assert usual["extinction"].prior.log
    asked = FIFTH.replace(*_added("priors", _PRIOR.format("base_m")))
    asked = asked.replace("weight = 0.5", 'weight = 0.5\nname = "cells"')
    own = {p.name: p for p in load(tmp_path, asked)["fog"].parameters}
    assert own["base"].prior == Prior(1.0, 9.0, 2.0)
    assert own["weight_cells"].default == 0.5
    assert "weight_2" not in own


def test_values_are_put_into_a_class_by_their_short_names(tmp_path):
    fog = load(tmp_path, FIFTH)["fog"]
    changed = fog.with_values({"top": 150.0, "weight_2": 0.7, "infrared_ratio": 0.4})
    assert changed.top_m == 150.0
    assert [t.weight for t in changed.textures] == [1.0, 0.7]
    assert changed.absorption_ratio == 0.4
    assert fog.absorption_ratio == pytest.approx(float(fog.optics.infrared_ratio))
    with pytest.raises(ValueError, match="fog has no 'weight_1'"):
        fog.with_values({"weight_1": 2.0})


def test_a_layer_takes_its_share_of_the_physical_extinction(tmp_path):
    fog = load(tmp_path, FIFTH)["fog"]
    whole, share = (
        class_layer(fog, sunlit=(1, 3), thermal=(13,), extinction_share=s)
        for s in (1.0, 0.1)
    )
    assert float(share.extinction_per_m) == pytest.approx(0.002)
    # What is absorbed in the infrared stays as it is.
    np.testing.assert_allclose(share.absorptions_per_m, whole.absorptions_per_m, 1e-6)
    assert whole.cloud.shell == fog.marched
    assert class_layer(fog, movable=True).cloud.shell == fog.shell
    assert class_layer(fog).optics.absorption.shape == (0,)


DOCS = Path(__file__).parents[2] / "docs"


def test_the_classes_of_the_documents_can_be_read_and_fitted(tmp_path):
    blocks = re.findall(r"```toml\n(.*?)```", (DOCS / "formats.md").read_text(), re.S)
    (fog,) = (block for block in blocks if block.startswith("[fog]"))
    example = load_classes(DOCS / "classes_example.toml")
    assert example["anvil_cirrus"].imagery is not None
    assert {n: example[n] for n in cloud_classes()} == cloud_classes()
    for one in (load(tmp_path, fog)["fog"], *example.values()):
        for p in one.parameters:
            assert p.prior.lower < p.default < p.prior.upper, p
