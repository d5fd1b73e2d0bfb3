"""`cloudjax fit`."""

import os
from pathlib import Path

import click

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


@click.command()
@click.argument("scenes", nargs=-1, required=True, metavar="SCENE...")
@bands_option
@click.option("-o", "--output", required=True, metavar="DIR", help="For the results.")
@fit_options
@classes_option
@ignore_weather_option
@weather_mask_option
@dask_option
@resume_option
def fit(scenes, output, runner, **chosen) -> int:
    """Fit the clouds of a scene to its radiances.

    Writes fit.json, parameters.toml, simulated.nc and report.html to DIR; of several
    scenes, to one folder each within DIR, beside a summary of all. Ctrl-C ends with the
    best so far, and --resume goes on.
    """
    from cloudjax_data.whole_files import require_writable

    from .many_scenes import run_scenes
    from .scene_tasks import EXIT_CODES

    require_writable(output)
    tasks = _tasks(scenes, output, runner, chosen)
    if len(tasks) > 1 or runner:
        return run_scenes(tasks, runner or Here(), Path(output), "Fits of scenes")
    (task,) = tasks
    task.check()
    outcome = task()
    if outcome.kept:
        click.echo(f"{outcome.name} {outcome.state} in an earlier run: {task.folder}")
    return EXIT_CODES[outcome.state]


def _tasks(scenes, output, runner, chosen) -> list:
    """The fits of all scenes, once their common options have been checked."""
    from cloudjax import load_classes
    from cloudjax_fit.settings import Settings, with_options
    from cloudjax_scenes.data_errors import data_errors

    from .scene_fit import SceneFit
    from .scene_tasks import distinct_names

    of_inputs = "bands", "classes", "ignore_weather", "weather_mask", "resume"
    given = {name: chosen[name] for name in of_inputs}
    options = {name: chosen[name] for name in chosen if name not in of_inputs}
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
            page=f"{name}/report.html" if several else "report.html",
            quiet=runner is not None,
            **given,
        )
        for scene, name in zip(scenes, names, strict=True)
    ]
