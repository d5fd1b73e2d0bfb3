"""What a reader of a fit is told to mind."""

import dataclasses

import numpy as np
import pytest
from tests.fit_results import made_up_result
from tests.scenes import write_scene

from cloudjax_fit.cautions import cautions
from cloudjax_fit.fit_inputs import read_inputs


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return made_up_result(read_inputs(write_scene(tmp_path_factory.mktemp("scene"))))


def cautions_of(result, **changes):
    image = result.image
    names = [layer.name for layer in result.scene.layers]
    depths = dict(zip(names, image.depths, strict=True))
    given = {
        "target": result.target,
        "estimates": result.estimates,
        "depths": depths,
        "earth": np.ones(image.cloud.shape, bool),
    }
    return cautions(**given | changes)


def test_a_sound_fit_has_none(result):
    assert cautions_of(result) == []


def test_parameters_at_bounds_are_named(result):
    first, second, *others = result.estimates
    moved = [dataclasses.replace(e, at_bound=True) for e in (first, second)]
    names = f"{first.parameter.name}, {second.parameter.name}"
    (said,) = cautions_of(result, estimates=[*moved, *others])
    assert said == f"Bounds, and not the data, hold {names}."


def test_a_class_that_is_nowhere_is_named(result):
    thin = np.full(result.image.cloud.shape, 0.02)
    thick = np.where(np.arange(thin.size).reshape(thin.shape) == 3, 0.1, thin)
    (said,) = cautions_of(result, depths={"cirrus": thin, "low_stratus": thick})
    assert said.startswith("The fitted image has no cirrus")


def test_missing_data_are_counted(result):
    good, earth = (np.zeros(result.image.cloud.shape, bool) for _ in range(2))
    good.reshape(-1)[:64] = True
    earth.reshape(-1)[:256] = True
    target = dataclasses.replace(result.target, good=good)
    assert cautions_of(result, target=target, earth=earth) == [
        "75% of the pixels that see the Earth have no data."
    ]


def test_a_band_of_one_value_is_named(result):
    tables = dict(result.target.quantiles)
    number, table = next(iter(tables.items()))
    flat = np.full(table.values.shape, 7.0)
    tables[number] = dataclasses.replace(table, values=flat)
    target = dataclasses.replace(result.target, quantiles=tables)
    (said,) = cautions_of(result, target=target)
    assert said.startswith(f"Band {number} is the same in all cloud pixels")
