"""Band 7 in fits: by day it reflects and emits, by night it emits."""

import numpy as np
import pytest
from tests.scenes import NIGHT, write_scene

from cloudjax.march.radiances import see_clear
from cloudjax.march.view import look_around
from cloudjax_data import DataError, sun_direction
from cloudjax_fit.fit_inputs import read_inputs
from cloudjax_fit.scene_parameters import scene_parameters


def test_by_day_the_sun_s_part_and_emission_add_to_what_is_seen(tmp_path):
    """Clear pixels of 290 K: the parts are positive and their sum is the target's."""
    made_of = read_inputs(write_scene(tmp_path / "day", (7, 13)), bands=(7, 13)).made_of
    imagery, scene = made_of.imagery, made_of.build()
    assert scene.bands == (7, 13)
    assert scene.reflective is not None
    assert scene.reflective.numbers == (7,)
    pixels = np.flatnonzero(imagery.grid.rays().ground()[1])[::50]
    around = look_around(scene, imagery.grid.rays(pixels), sun_direction(imagery.time))
    behind = see_clear(scene, around)[0]
    assert behind.reflective is not None
    assert behind.emissive is not None
    assert (np.asarray(behind.reflective) > 0).all()
    assert (np.asarray(behind.emissive) > 0).all()
    seen = np.asarray(scene.total(behind))
    levels = imagery.background.radiance[7]
    assert seen[0].min() >= levels.min() * (1 - 1e-6)
    assert seen[0].max() <= levels.max() * (1 + 1e-6)
    names = [p.name for p in scene_parameters(made_of)]
    assert len(names) == len(set(names))
    assert "air.sun_gain_C07" in names
    # Sunlit cloud is warm in band 7: the window alone tells it from the surface.
    assert imagery.rule.cold_band == 13


def test_by_night_it_emits_and_tells_cloud(tmp_path):
    folder = write_scene(tmp_path / "night", (7, 13), NIGHT)
    made_of = read_inputs(folder, bands=(7,)).made_of
    assert not made_of.imagery.bands[7].sunlit
    assert made_of.build().reflective is None
    assert made_of.imagery.rule.cold_band == 7


def test_alone_by_day_it_tells_no_cloud(tmp_path):
    with pytest.raises(DataError, match="none of the bands"):
        read_inputs(write_scene(tmp_path / "day", (7,)))
