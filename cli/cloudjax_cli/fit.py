"""`cloudjax fit`."""

import os
from pathlib import Path

import click

from .fit_quality import AskedFit, fit_quality_options
from .options import (
    bands_option,
    classes_option,
    dask_option,
    fit_options,
    ignore_weather_option,
    resume_option,
    weather_mask_option,
)
from .runners import Here


class _TestsOfAJointFit(click.Command):
    """Lets one --test have several scenes: all up to the next option."""

    def parse_args(self, ctx, args):
        found, testing = [], False
        for arg in args:
            if arg == "--test":
                testing = True
            elif arg.startswith("-"):
                testing = False
                found.append(arg)
            else:
                found += ["--test", arg] if testing else [arg]
        return super().parse_args(ctx, found)


@click.command(cls=_TestsOfAJointFit)
@click.argument("scenes", nargs=-1, required=True, metavar="SCENE...")
@bands_option
@click.option("-o", "--output", required=True, metavar="DIR", help="For the results.")
@fit_options
@fit_quality_options
@classes_option
@ignore_weather_option
@weather_mask_option
@dask_option
@resume_option
@click.option(
    "--joint",
    is_flag=True,
    help="Fit the scenes together: clouds in common, air and calibration of each.",
)
@click.option(
    "--shared", metavar="TOML", help="Joint fit: which parameters are in common."
)
@click.option(
    "--test",
    "tests",
    multiple=True,
    metavar="SCENE...",
    help="Joint fit: scenes that are not fitted, but seen with what is in common.",
)
def fit(scenes, output, runner, joint, shared, tests, **chosen) -> int:
    """Fit the clouds of a scene to its radiances.

    Writes fit.json, parameters.toml, simulated.nc and report.html to DIR; of several
    scenes, to one folder each within DIR, beside a summary of all. Ctrl-C ends with the
    best so far, and --resume goes on.
    """
    from cloudjax_data.whole_files import require_writable

    from .many_scenes import run_scenes
    from .scene_tasks import EXIT_CODES

    wanted = AskedFit.of(chosen)
    require_writable(output)
    if joint:
        if wanted.by_front:
            raise click.UsageError(
                "no front is of joint fits: give --quality, or --rays and --steps"
            )
        return _fit_together(scenes, tests, output, runner, shared, chosen)
    if shared or tests:
        option = "--shared" if shared else "--test"
        raise click.UsageError(f"{option} is of joint fits: add --joint")
    tasks = _tasks(scenes, output, runner, chosen, wanted)
    if len(tasks) > 1 or runner:
        return run_scenes(tasks, runner or Here(), Path(output), "Fits of scenes")
    (task,) = tasks
    task.check()
    outcome = task()
    if outcome.kept:
        click.echo(f"{outcome.name} {outcome.state} in an earlier run: {task.folder}")
    return EXIT_CODES[outcome.state]


def _fit_together(scenes, tests, output, runner, shared, chosen) -> int:
    from cloudjax_fit.sharing import read_sharing

    if runner is not None:
        raise click.UsageError("a joint fit is one task: leave out --dask")
    if len(scenes) + len(tests) < 2:
        raise click.UsageError("a joint fit needs several scenes: leave out --joint")
    sharing = read_sharing(shared)
    tasks = _tasks((*scenes, *tests), output, None, chosen, AskedFit())
    fits, others = tasks[: len(scenes)], tasks[len(scenes) :]

    from .joint_scenes import JointScenes

    return JointScenes(fits, others, Path(output), sharing, chosen["resume"])()


def _tasks(scenes, output, runner, chosen, wanted: AskedFit) -> list:
    """The fits of all scenes, once their common options have been checked."""
    from cloudjax import load_classes
    from cloudjax_fit.settings import Settings, with_options
    from cloudjax_scenes.data_errors import data_errors

    from .scene_fit import SceneFit
    from .scene_tasks import distinct_names

    of_inputs = "bands", "classes", "ignore_weather", "weather_mask", "resume"
    given = {name: chosen[name] for name in of_inputs}
    of_front = "max_error", "max_seconds"
    options = {n: chosen[n] for n in chosen if n not in (*of_inputs, *of_front)}
    with_options(Settings(), options)
    # Workers elsewhere have other working folders.
    located = os.path.abspath if runner else str
    if given["classes"] is not None:
        given["classes"] = located(given["classes"])
        with data_errors():
            load_classes(given["classes"])
    names = distinct_names(scenes)
    several = len(scenes) > 1
    return [
        SceneFit(
            located(scene),
            located(os.path.join(output, name) if several else output),
            options=options,
            wanted=wanted,
            page=f"{name}/report.html" if several else "report.html",
            quiet=runner is not None,
            **given,
        )
        for scene, name in zip(scenes, names, strict=True)
    ]
