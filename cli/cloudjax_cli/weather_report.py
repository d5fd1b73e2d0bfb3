"""`cloudjax report IMAGE --weather ANALYSIS`."""

from collections.abc import Sequence
from pathlib import Path

import click


PAGE = "report.html"


def report_on_weather(
    image: str,
    weather: str,
    folder: Path,
    bands: Sequence[int] | None,
    *,
    allow_mismatch: bool,
) -> None:
    """Compare the clouds of an image with those of its analysis, in files and words."""
    from cloudjax_data import read_weather
    from cloudjax_data.whole_files import require_writable, staged
    from cloudjax_fit.radiance_files import chosen
    from cloudjax_fit.validation.page import write_validation
    from cloudjax_fit.validation.seen_earth import read_seen_earth
    from cloudjax_fit.validation.validation import validate

    require_writable(folder)
    seen = read_seen_earth(image)
    chosen(seen.bands, bands, image)
    found = validate(seen, read_weather(weather), bands, allow_mismatch=allow_mismatch)
    with staged(folder, last=PAGE) as aside:
        write_validation(aside / PAGE, found)
    for sentence in found.warnings:
        click.echo(sentence)
    for one in found.requirements:
        click.echo(f"  {one.words}")
    click.echo(f"  {folder / PAGE}")
