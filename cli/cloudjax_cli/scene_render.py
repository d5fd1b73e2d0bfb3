"""The image of one scene of many."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import perf_counter

import click
import numpy as np

from cloudjax_fit.outcome import RENDERED, Outcome

from .quality_options import AskedQuality
from .scene_tasks import scene_name


@dataclass(frozen=True)
class SceneRender:
    """The image of a scene folder, in a netCDF file with a picture beside it.

    **Fields:**

    - `scene`, `path`: of the folder and of the file.
    - `options`: `steps`, `seed` and `light`, as of `FitSettings`; None leaves one as it
      is.
    - `bands`, `classes`, `ignore_weather`: as of `read_inputs`.
    - `parameters`: the file of a fit; `quality`: what is asked of it.
    - `quantities`: names of what the file holds.
    - `resume`: what an earlier run has done stays.
    """

    scene: str
    path: str
    bands: tuple[int, ...] | None = None
    options: Mapping[str, int | str | None] = field(default_factory=dict)
    classes: str | None = None
    parameters: str | None = None
    ignore_weather: bool = False
    quality: AskedQuality = field(default_factory=AskedQuality)
    quantities: Sequence[str] = ("radiance",)
    resume: bool = False

    @property
    def name(self) -> str:
        """Return the name of the scene's folder."""
        return scene_name(self.scene)

    def check(self) -> None:
        """See `SceneTask`."""
        from cloudjax_data import open_folder
        from cloudjax_data.whole_files import require_writable
        from cloudjax_fit.fit_inputs import folder_settings

        require_writable(Path(self.path).parent)
        folder_settings(open_folder(self.scene))

    def __call__(self) -> Outcome:
        """See `SceneTask`."""
        from cloudjax_data.output_lock import alone

        path, started = Path(self.path), perf_counter()
        with alone(path.parent, path.name):
            asked = self._asked()
            kept = self.resume and _is_whole(path, asked)
            cloud = _cloud_of(path) if kept else self._render(path, asked)
        return Outcome(
            self.name,
            RENDERED,
            f"written to {path.name}",
            seconds=perf_counter() - started,
            simulated_cloud=cloud,
            page=path.with_suffix(".png").name,
            kept=kept,
        )

    def _asked(self) -> str:
        from cloudjax_data import open_folder
        from cloudjax_fit.asked import asked_of
        from cloudjax_fit.fit_inputs import folder_settings
        from cloudjax_fit.settings import with_options

        folder = open_folder(self.scene)
        settings = with_options(folder_settings(folder), self.options)
        options = {
            "bands": self.bands,
            "ignore_weather": self.ignore_weather,
            "quality": asdict(self.quality),
            "quantities": list(self.quantities),
        }
        files = self.classes, self.parameters
        return asked_of(folder, settings, options, files)

    def _render(self, path: Path, asked: str) -> float:
        from cloudjax_fit.fit_inputs import read_inputs
        from cloudjax_fit.fitted_image import fitted_image
        from cloudjax_fit.parameter_file import read_parameters
        from cloudjax_scenes.band_image import chosen_quantities
        from cloudjax_scenes.image_file import write_image_and_picture
        from cloudjax_scenes.trade.stopwatch import Stopwatch

        inputs = read_inputs(
            self.scene,
            bands=self.bands,
            options=self.options,
            classes=self.classes,
            fitted=read_parameters(self.parameters) if self.parameters else None,
            ignore_weather=self.ignore_weather,
        )
        for note in inputs.made_of.notes:
            click.echo(f"mind: {note}", err=True)
        imagery, seed = inputs.target.imagery, inputs.settings.fit.seed
        quantities = chosen_quantities(self.quantities, imagery.bands.values())
        quality, choice = self._chosen(inputs)
        watch = Stopwatch()
        with watch.running():
            image, values = fitted_image(inputs, quality)
        write_image_and_picture(
            path,
            image,
            imagery,
            values,
            seed,
            quantities,
            light=inputs.made_of.light,
            quality=quality,
            asked=asked,
        )
        if choice is not None:
            choice.tell(watch)
        return float(image.cloud[np.isfinite(image.radiance[0])].mean())

    def _chosen(self, inputs):
        """The quality that is asked, and the choice that told, if one did."""
        from cloudjax_scenes.quality import Quality
        from cloudjax_scenes.trade.subjects import imagery_outline

        if not self.quality.by_front:
            return self.quality.by_hand(Quality(steps=inputs.settings.fit.steps)), None
        imagery, light = inputs.made_of.imagery, inputs.made_of.light
        rays, _ = imagery.on_earth()
        outline = imagery_outline(imagery, light, self.quality.shadows, rays)
        choice = self.quality.by_measure(outline)
        return choice.quality, choice


def _is_whole(path: Path, asked: str) -> bool:
    """Whether an earlier run has been asked the same and has come to its end."""
    import xarray as xr

    if not (path.is_file() and path.with_suffix(".png").is_file()):
        return False
    try:
        with xr.open_dataset(path) as data:
            return data.attrs.get("asked") == asked
    except (OSError, ValueError):
        return False


def _cloud_of(path: Path) -> float:
    import xarray as xr

    with xr.open_dataset(path) as data:
        radiance = next(v for n, v in data.items() if "_C" in str(n))
        return float(data["cloud_weight"].where(np.isfinite(radiance)).mean())
