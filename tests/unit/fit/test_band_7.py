"""Band 7 in fits: by day it reflects and emits, by night it emits."""

import numpy as np
import pytest
from tests.scenes import NIGHT, write_scene

from cloudjax_data import DataError
from cloudjax_fit.fitted_scene import background, build_scene, scene_parameters
from cloudjax_fit.scene_run import prepare


def test_by_day_the_sun_s_part_and_emission_add_to_what_is_seen(tmp_path):
    """Clear pixels of 290 K: the parts are positive and their sum is the target's."""
    target = prepare(write_scene(tmp_path / "day", (7, 13)), bands=(7, 13)).target
    scene = build_scene(target)
    assert scene.bands == (7, 13)
    assert scene.reflective is not None
    assert scene.reflective.numbers == (7,)
    pixels = np.flatnonzero(target.grid.rays().ground()[1])[::50]
    behind = background(target, target.grid.rays(pixels))
    assert behind.reflective is not None
    assert behind.emissive is not None
    assert (np.asarray(behind.reflective) > 0).all()
    assert (np.asarray(behind.emissive) > 0).all()
    seen = np.asarray(scene.total(behind))
    levels = target.bands[7].background
    assert seen[0].min() >= levels.min() * (1 - 1e-6)
    assert seen[0].max() <= levels.max() * (1 + 1e-6)
    names = [p.name for p in scene_parameters(scene, target)]
    assert len(names) == len(set(names))
    assert "air.sun_gain_C07" in names
    # Sunlit cloud is warm in band 7: the window alone tells it from the surface.
    assert target.rule.cold_band == 13


def test_by_night_it_emits_and_tells_cloud(tmp_path):
    target = prepare(write_scene(tmp_path / "night", (7, 13), NIGHT), bands=(7,)).target
    assert not target.bands[7].sunlit
    assert build_scene(target).reflective is None
    assert target.rule.cold_band == 7


def test_alone_by_day_it_tells_no_cloud(tmp_path):
    with pytest.raises(DataError, match="none of the bands"):
        prepare(write_scene(tmp_path / "day", (7,)))
