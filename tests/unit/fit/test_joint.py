"""Several scenes fitted together."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tests.small_fits import (
    Killed,
    flecked,
    killed_at,
    small_class,
    small_imagery,
    small_target,
)

from cloudjax_data import DataError
from cloudjax_fit.checkpoint import Checkpoint
from cloudjax_fit.fit_settings import FitSettings
from cloudjax_fit.fittable_scene import FittableScene
from cloudjax_fit.joint_fitting import JointFit, joint_fit
from cloudjax_fit.joint_problem import JointProblem
from cloudjax_fit.objective import QUARTERS, residuals_and_sums
from cloudjax_fit.parameters import Parameters
from cloudjax_fit.sharing import Sharing, join, read_sharing
from cloudjax_fit.solver import Solution
from cloudjax_fit.uncertainty import estimate


SETTINGS = FitSettings(rays=576, steps=4, max_steps=5, seed=3, statistics="values")
MOVED = ("low.threshold", "low.extinction", "low.top", "air.gain_C01")
SHARING = read_sharing()


def _scene(name: str, seed: int, **changes) -> FittableScene:
    """A scene of 24 x 24 pixels, of which a fit moves four parameters."""
    imagery = small_imagery(name=name, **changes)
    scene = FittableScene.of(
        small_target(imagery, flecked(seed)), SETTINGS, classes={"low": small_class()}
    )
    held = {p.name: {"free": False} for p in scene.parameters if p.name not in MOVED}
    return FittableScene.of(
        scene.target, SETTINGS, overrides=held, classes={"low": small_class()}
    )


@pytest.fixture(scope="module")
def scenes() -> list[FittableScene]:
    return [_scene("a", 0), _scene("b", 1)]


@pytest.fixture(scope="module")
def fitted(scenes) -> JointFit:
    return joint_fit(scenes, SHARING)


def test_heights_and_calibration_are_each_scenes_own(scenes):
    joined = join(scenes, SHARING)
    assert joined.shared == ["low.threshold", "low.extinction"]
    own = [p.name for p in joined.parameters if p.name not in joined.shared]
    assert own == [f"{s}: {name}" for s in "ab" for name in ("low.top", "air.gain_C01")]
    for scene, places in zip(scenes, joined.places, strict=True):
        names = [joined.parameters[i].name.split(": ")[-1] for i in places]
        assert names == [p.name for p in scene.free]


@pytest.fixture(scope="module")
def alone(scenes, fitted):
    """Residuals, slopes and sums of each scene where the joint fit has ended."""
    z = fitted.solution.z
    return [
        _compared(jnp.asarray(z[places]), scene.pose())
        for scene, places in zip(scenes, fitted.joined.places, strict=True)
    ]


@eqx.filter_jit
def _compared(z, problem):
    def rows(z):
        rows, sums = residuals_and_sums(z, problem)
        return rows, (rows, sums)

    slopes, (rows, sums) = jax.jacfwd(rows, has_aux=True)(z)
    return rows, slopes, sums


def test_what_is_compared_is_that_of_each_scene(fitted, alone):
    """Loss and slopes are those of each scene alone, the priors counted once.

    Tolerance: rounding of float32.
    """
    z, places = fitted.solution.z, fitted.joined.places
    priors = Parameters.of(fitted.joined.parameters).surprise(jnp.asarray(z))
    data = [rows[: -len(own)] for (rows, *_), own in zip(alone, places, strict=True)]
    loss = 0.5 * sum((np.asarray(some) ** 2).sum() for some in (*data, priors))
    assert fitted.solution.loss == pytest.approx(loss, rel=1e-4)
    columns = []
    for (_, slopes, _), own in zip(alone, places, strict=True):
        columns.append(np.zeros((len(slopes) - len(own), len(z))))
        columns[-1][:, own] = slopes[: -len(own)]
    expected = np.concatenate(columns)
    found = fitted.solution.jacobian
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found[: len(expected)], expected, atol=1e-4 * scale)
    assert len(found) == len(expected) + len(z)


def test_scenes_of_one_structure_share_a_function(scenes):
    few = replace(_scene("c", 2), settings=replace(SETTINGS, rays=100))
    _, joint = _joined([scenes[0], few, scenes[1]])
    assert [len(group) for group in joint.groups] == [2, 1]


@pytest.mark.parametrize(("fewest", "each"), [(100, 288), (400, 400), (2048, 576)])
def test_scenes_share_the_rays_and_each_has_enough(scenes, monkeypatch, fewest, each):
    """Of 576 rays each of two scenes has half, and no fewer than are enough."""
    posed = []

    def solve(problem, *_):
        posed.append(problem)
        raise StopIteration

    monkeypatch.setattr("cloudjax_fit.joint_fitting.FEWEST_RAYS", fewest)
    monkeypatch.setattr("cloudjax_fit.joint_fitting.solve_and_estimate", solve)
    with pytest.raises(StopIteration):
        joint_fit(scenes, SHARING)
    ((group,),) = (problem.groups for problem in posed)
    assert group.problems.known.shape == (2, each)


def _joined(scenes, sharing=SHARING):
    joined = join(scenes, sharing)
    problems = [scene.pose() for scene in scenes]
    parameters = Parameters.of(joined.parameters)
    return joined, JointProblem.of(parameters, problems, joined.places)


def test_a_joint_fit_gains_on_its_start_and_writes_one_value_for_all(fitted):
    history = fitted.solution.history
    assert history[-1] < 0.9 * history[0]
    a, b = fitted.results()
    values = [{e.parameter.name: e.value for e in one.estimates} for one in (a, b)]
    for name, found in fitted.shared.items():
        assert values[0][name] == values[1][name] == found.value
    assert values[0]["low.top"] != values[1]["low.top"]
    assert a.target.imagery.name == "a"
    for one in (a, b):
        assert one.distances_fit[13].w1 < one.distances_start[13].w1


def test_a_killed_joint_fit_ends_where_it_would_have_ended(scenes, fitted, tmp_path):
    """Killed with its third step: the two before are not done again."""
    checkpoint = Checkpoint(tmp_path / "checkpoint", "this")
    with pytest.raises(Killed):
        joint_fit(scenes, SHARING, on_step=killed_at(2), checkpoint=checkpoint)
    done = []
    again = joint_fit(
        scenes,
        SHARING,
        on_step=lambda step, loss: done.append(step),
        checkpoint=checkpoint,
    )
    assert done == list(range(2, len(fitted.solution.history) - 1))
    assert again.solution.history == pytest.approx(fitted.solution.history, rel=1e-6)
    for found, expected in zip(again.estimates, fitted.estimates, strict=True):
        assert found.value == pytest.approx(expected.value, rel=1e-5)
        assert found.std == pytest.approx(expected.std, rel=1e-4)


def test_two_scenes_know_more_than_one(scenes, alone):
    """The same scene twice, all of it shared: half the variance that the data leave.

    Tolerance: 1 %, for the priors, made vague, still have a say.
    """
    _, slopes, sums = (jax.tree.map(np.asarray, part) for part in alone[0])
    count = slopes.shape[1]
    data, priors = 100 * slopes[:-count], slopes[-count:]
    stds = []
    for times in (1, 2):
        joined, joint = _joined([scenes[0]] * times, Sharing({"*": True}))
        jacobian = np.concatenate([data] * times + [priors])
        stacked = [[np.stack([one] * times) for one in sums]]
        solution = Solution(np.zeros(count), True, "", jacobian, stacked, (1.0,), 0.0)
        z = jnp.zeros(count)
        quarters = np.stack([jacobian / QUARTERS] * QUARTERS)
        found, _ = estimate(joint, joined.parameters, z, solution, quarters, seed=0)
        stds.append({e.parameter.name: e.std for e in found}["low.extinction"])
    assert stds[1] / stds[0] == pytest.approx(np.sqrt(0.5), rel=0.01)


def test_a_scene_that_is_tested_has_the_shared_values_and_its_own_defaults(
    scenes, fitted
):
    tested = fitted.tested(scenes[1])
    scene = scenes[1].with_values({n: e.value for n, e in fitted.shared.items()})
    cloud = scene.layers[0].cloud
    default = scenes[1].scene.layers[0].cloud
    assert float(cloud.function.top_m) == float(default.function.top_m)
    assert float(cloud.function.threshold) != float(default.function.threshold)
    assert tested.distances_fit[13].w1 != tested.distances_start[13].w1
    assert tested.image.radiance.shape == (2, 24, 24)


def test_what_scenes_share_they_must_agree_on(scenes):
    parameters = [
        replace(p, spread=9.0) if p.name == "low.threshold" else p
        for p in scenes[1].parameters
    ]
    other = replace(scenes[1], parameters=parameters)
    with pytest.raises(DataError, match=r"a and b have different values of spread"):
        join([scenes[0], other], SHARING)
    join([scenes[0], other], Sharing({"low.threshold": False} | dict(SHARING.rules)))
    other = replace(scenes[1], settings=replace(SETTINGS, seed=4))
    with pytest.raises(DataError, match="a asks for seed = 3 and b for 4"):
        joint_fit([scenes[0], other], SHARING)


def test_a_table_of_sharing_comes_before_the_default(tmp_path):
    file = tmp_path / "s.toml"
    file.write_text('[shared]\n"*.top" = true\n"low.*" = false\n')
    sharing = read_sharing(file)
    assert sharing.shares("low.top")
    assert not sharing.shares("low.threshold")
    assert sharing.shares("cirrus.threshold")
    assert not sharing.shares("air.gain_C01")
    file.write_text("[shared]\nx = 3\n")
    with pytest.raises(DataError, match=r"s.toml gives x = 3"):
        read_sharing(file)
