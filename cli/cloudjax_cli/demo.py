"""`cloudjax demo`."""

from pathlib import Path

import click

from .options import fit_options


@click.command()
@click.option("-o", "--output", default="out/demo", metavar="DIR", show_default=True)
@fit_options
def demo(output, **options) -> int:
    """Fit the embedded scene and write its report; needs no network.

    The scene is GOES-17 off southern California, 2019-10-27 20:00 UTC, bands 1, 3, 13,
    fitted in the paper's light, which is compiled in a third of the time.
    """
    from cloudjax_data.whole_files import require_writable
    from cloudjax_fit.embedded import embedded_target
    from cloudjax_fit.fit_settings import FitSettings
    from cloudjax_fit.settings import Settings, with_options
    from cloudjax_scenes.lights import PAPER

    from .fit_folder import fit_and_write
    from .scene_tasks import EXIT_CODES

    require_writable(output)
    settings = with_options(Settings(fit=FitSettings(light=PAPER.name)), options)
    numbers = fit_and_write(embedded_target(), Path(output), settings.fit)
    return EXIT_CODES[numbers["status"]]
