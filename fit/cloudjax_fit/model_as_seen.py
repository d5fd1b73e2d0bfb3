"""A weather model is rendered as an image was seen, to be compared with it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cloudjax_scenes.band_image import BandImage
from cloudjax_scenes.image_strips import render_strips
from cloudjax_scenes.model_scene import ModelWorld
from cloudjax_scenes.quality import STANDARD, Quality
from cloudjax_scenes.quantity import RADIANCE
from cloudjax_scenes.sensors import Sensor

from .air_column import AirColumn, model_air
from .band_radiances import BandRadiances
from .model_match import Match


@dataclass(frozen=True, eq=False)
class ModelBeside:
    """A `ModelBeside` is a model beside an image, on the pixels that both have.

    **Fields:**

    - `image`, `model`: radiances by band.
    - `air`: of the model.
    - `facts`: what was compared, in words.
    - `warnings`: sentences, first of all on what does not match.
    """

    image: dict[int, BandRadiances]
    model: dict[int, BandRadiances]
    air: AirColumn
    facts: dict[str, str]
    warnings: tuple[str, ...]


def model_beside(
    match: Match,
    *,
    quality: Quality = STANDARD,
    on_tile: Callable[[int, int], None] | None = None,
) -> ModelBeside:
    """Render a model as the sensor of an image would have seen it.

    From where the image was seen, in its bands, with the sun of its time: only the
    clouds, the air and the ground are the model's.

    **Arguments:** `on_tile`: called with numbers of pixels.

    **Raises:** `DataError` where the model has no cloud, and where bands of the image
    have pixels that do not nest.
    """
    vantage, overlap = match.vantage, match.overlap
    # First, for its errors come soon.
    image = vantage.cropped(overlap.grid, overlap.over)
    world = quality.of_world(ModelWorld(match.columns))
    assert isinstance(world, ModelWorld)
    sensor = Sensor("as the image", "ABI", overlap.grid, vantage.bands)
    rendered = render_strips(
        world, sensor, sensor.choose(None), vantage.time, on_tile=on_tile
    )
    strips = list(rendered)
    return ModelBeside(
        image=image,
        model={
            n: _radiances(match, seen, [strip.band(n) for strip in strips])
            for n, seen in image.items()
        },
        air=model_air(world),
        facts=_facts(match),
        warnings=(
            *(f"No match: {clause}." for clause in match.mismatches),
            *match.columns.cautions(),
            *vantage.notes,
        ),
    )


def _radiances(
    match: Match, like: BandRadiances, strips: list[BandImage]
) -> BandRadiances:
    """The rendered band, in the quantity of the image, where there are columns."""
    seen = np.concatenate(
        [s.radiance if like.quantity is RADIANCE else s.shown for s in strips]
    )
    return BandRadiances(
        like.number,
        like.units,
        np.where(match.overlap.over, seen, np.nan),
        like.quantity,
        match.overlap.grid,
        match.vantage.time,
        match.vantage.bands[like.number],
    )


def _facts(match: Match) -> dict[str, str]:
    vantage, overlap = match.vantage, match.overlap
    rows, columns = overlap.grid.shape
    return {
        "image of": f"{vantage.time:%Y-%m-%d %H:%M:%S} UTC",
        "model of": f"{match.columns.time:%Y-%m-%d %H:%M:%S} UTC, with the sun of the "
        "image",
        "seen from above": f"longitude {vantage.grid.subsatellite_longitude_deg:g}",
        "compared": f"{overlap.over.sum()} pixels of {vantage.resolution_km:g} km, in "
        f"a box of {rows} x {columns}",
        "columns in the image": f"{overlap.of_columns:.1%}",
        "image over columns": f"{overlap.of_image:.1%}",
    }
