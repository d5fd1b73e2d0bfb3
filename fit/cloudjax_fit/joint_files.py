"""The files of a joint fit, beside those of each of its scenes."""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from cloudjax_data.whole_files import staged
from cloudjax_scenes.image_file import image_dataset
from cloudjax_scenes.netcdf import write_netcdf
from cloudjax_scenes.quality import Quality

from .fit_files import IMAGE, PARAMETERS
from .fit_result import CONVERGED, NOT_CONVERGED
from .joint_fitting import JointFit, TestedScene
from .parameter_file import parameters_text
from .plain_data import plain
from .result_numbers import distance_numbers, estimate_numbers
from .versions import versions


# Written last: where it is, all others are whole, those of the scenes too.
JOINT = "joint.json"


def write_joint_fit(
    joint: JointFit,
    tests: Sequence[TestedScene],
    folder: str | os.PathLike[str],
    *,
    asked: str = "",
) -> dict[str, Any]:
    """Write `joint.json` and `parameters.toml`, the classes with the shared values.

    **Arguments:** `asked`: a digest of what the fit was asked to do.

    **Returns:** the content of `joint.json`.

    **Raises:** `DataError` if the disk does not take the files.
    """
    numbers = joint_numbers(joint, tests) | {"asked": asked}
    with staged(folder, last=JOINT) as aside:
        (aside / PARAMETERS).write_text(_parameters(joint), encoding="utf-8")
        text = json.dumps(numbers, indent=2, allow_nan=False)
        (aside / JOINT).write_text(text + "\n", encoding="utf-8")
    return numbers


def joint_numbers(joint: JointFit, tests: Sequence[TestedScene]) -> dict[str, Any]:
    """Return the content of `joint.json`; None stands for what is not finite."""
    return plain(
        {
            "status": joint.state,
            "message": joint.status,
            "seconds": joint.phases.seconds,
            "settings": asdict(joint.settings),
            "scenes": [scene.name for scene in joint.scenes],
            "shared": {n: estimate_numbers(e) for n, e in joint.shared.items()},
            "undetermined": joint.undetermined,
            "tests": {test.scene.name: _test_numbers(test) for test in tests},
            "history": list(joint.solution.history),
            "versions": versions(),
        }
    )


def _test_numbers(test: TestedScene) -> dict[str, Any]:
    return {
        "cloud_fraction": test.cloud_fractions,
        "bands": {
            str(number): _distances(test, number) for number in test.distances_fit
        },
    }


def _distances(test: TestedScene, number: int) -> dict[str, float]:
    start, fit = test.distances_start[number], test.distances_fit[number]
    return distance_numbers(start, "start") | distance_numbers(fit, "fit")


def write_test(test: TestedScene, folder: str | os.PathLike[str]) -> None:
    """Write the image of a scene that was not fitted, `simulated.nc`.

    **Raises:** `DataError` if the disk does not take it.
    """
    scene = test.scene
    image = image_dataset(
        test.image,
        scene.target.imagery,
        test.values,
        scene.settings.seed,
        light=scene.made_of.light,
        quality=Quality(steps=scene.settings.steps),
    )
    with staged(folder, last=IMAGE) as aside:
        write_netcdf(aside / IMAGE, image)


def whole_joint(folder: str | os.PathLike[str], asked: str) -> Mapping[str, Any] | None:
    """Read the `joint.json` of a joint fit that has ended, None where there is none.

    **Arguments:** `asked`: the digest of what the fit must have been asked to do.
    """
    try:
        numbers = json.loads((Path(folder) / JOINT).read_text(encoding="utf-8"))
        ended = numbers["status"] in (CONVERGED, NOT_CONVERGED)
        return numbers if ended and numbers["asked"] == asked else None
    except (OSError, ValueError, KeyError, TypeError):
        # None, or of another version: what is asked for is not there.
        return None


def _parameters(joint: JointFit) -> str:
    """Classes that any scene has, with the shared values and defaults elsewhere."""
    shared = {e.parameter: e.value for e in joint.shared.values()}
    classes = {
        name: scene.made_of.available[name]
        for scene in joint.scenes
        for name in scene.target.imagery.fractions
    }
    light = joint.scenes[0].made_of.light
    title = f"Parameters of {len(joint.scenes)} scenes together"
    if joint.solution.interrupted:
        title += f": {joint.status}"
    return parameters_text(classes.values(), shared, light, title)
