"""`cloudjax fit`."""

from pathlib import Path

import click

from .options import (
    bands_option,
    classes_option,
    fit_options,
    ignore_weather_option,
    weather_mask_option,
)


@click.command()
@click.argument("scenes", nargs=-1, required=True, metavar="SCENE...")
@bands_option
@click.option("-o", "--output", required=True, metavar="DIR", help="For the results.")
@fit_options
@classes_option
@ignore_weather_option
@weather_mask_option
def fit(scenes, bands, output, classes, ignore_weather, weather_mask, **options) -> int:
    """Fit the clouds of a scene to its radiances.

    Writes fit.json, parameters.toml, simulated.nc and report.html to DIR; of several
    scenes, to one folder each within DIR.
    """
    from cloudjax_data import open_folder
    from cloudjax_data.whole_files import require_writable
    from cloudjax_fit.fit_inputs import folder_settings, read_inputs

    from .fit_folder import fit_and_write

    folders = _output_folders(scenes, Path(output))
    for scene, folder in folders.items():
        # The errors that are found at once, before hours of work on other scenes.
        require_writable(folder)
        folder_settings(open_folder(scene))
    codes = []
    for scene, folder in folders.items():
        inputs = read_inputs(
            scene,
            bands=bands,
            options=options,
            classes=classes,
            ignore_weather=ignore_weather,
            weather_mask=weather_mask,
        )
        codes.append(
            fit_and_write(
                inputs.target,
                folder,
                inputs.settings.fit,
                overrides=inputs.overrides,
                analysis=inputs.analysis,
                classes=inputs.made_of.known,
                observed=inputs.observed,
            )
        )
    return max(codes)


def _output_folders(scenes: tuple[str, ...], output: Path) -> dict[str, Path]:
    if len(scenes) == 1:
        return {scenes[0]: output}
    folders = {scene: output / Path(scene).resolve().name for scene in scenes}
    if len(set(folders.values())) < len(scenes):
        raise click.UsageError("two of the scenes have the same name: fit them apart")
    return folders
