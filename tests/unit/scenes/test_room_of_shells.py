"""Clouds that imagery places higher than their class stands have the air they need."""

from dataclasses import replace

import numpy as np
import pytest

from cloudjax import FractalCloud, imagery_classes
from cloudjax_scenes import SceneFromImagery
from cloudjax_scenes.imagery_evidence import ClassEvidence
from tests.small_fits import small_imagery


CLASSES = imagery_classes()


def _cloud(made_of: SceneFromImagery) -> FractalCloud:
    (layer,) = made_of.build().layers
    assert isinstance(layer.cloud, FractalCloud)
    return layer.cloud


def _scene(name: str, top_m: float, highest_m: float) -> SceneFromImagery:
    """Imagery of one class, whose highest clouds are so far above the others."""
    imagery = small_imagery(names=(name,))
    nodes = np.zeros((8, 8, 3))
    nodes[3, 4, 1], nodes[5, 2, 1] = highest_m, -500.0
    told = ClassEvidence(imagery.latitude_deg, imagery.longitude_deg, nodes, top_m)
    return SceneFromImagery(replace(imagery, evidence={name: told}), known=CLASSES)


@pytest.mark.parametrize("highest_m", [0.0, 1800.0, 4000.0])
def test_a_shell_holds_the_highest_clouds_and_what_a_fit_may_raise_them_by(highest_m):
    """8000 m, the field, and three deviations of the prior of 1000 m."""
    cloud = _cloud(_scene("cirrus", 8000.0, highest_m))
    shell, usual = cloud.shell, CLASSES["cirrus"].shell
    assert shell.top_m == max(usual.top_m, 8000.0 + highest_m + 3 * 1000.0)
    assert shell.bottom_m == usual.bottom_m
    assert float(cloud.function.top_m) == pytest.approx(8000.0)


def test_a_scene_of_found_parameters_stands_where_these_say():
    cloud = _cloud(replace(_scene("cirrus", 8000.0, 4000.0), placed=False))
    assert cloud.shell == CLASSES["cirrus"].shell
    assert float(cloud.function.top_m) == CLASSES["cirrus"].top_m
