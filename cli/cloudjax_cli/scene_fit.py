"""The fit of one scene of many."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cloudjax_fit.outcome import Outcome

from .fit_quality import AskedFit, told_time
from .progress import fit_progress, no_progress
from .scene_tasks import scene_name


if TYPE_CHECKING:
    from cloudjax_fit.fit_inputs import FitInputs
    from cloudjax_fit.trade.fronts import ExpectedFit


@dataclass(frozen=True)
class SceneFit:
    """The fit of a scene folder, with its files in another folder.

    **Fields:**

    - `scene`, `folder`: paths; `page`: of the report, from the folder of the summary.
    - `options`: of the fit, by the names of `FitSettings`; None leaves one as it is.
    - `wanted`: what rays and steps are chosen by, where they are not given.
    - `bands`, `classes`, `ignore_weather`, `weather_mask`: as of `read_inputs`.
    - `resume`: what an earlier run has done stays, and what it began goes on.
    - `quiet`: nothing is printed.
    """

    scene: str
    folder: str
    bands: tuple[int, ...] | None = None
    options: Mapping[str, int | str | None] = field(default_factory=dict)
    classes: str | None = None
    ignore_weather: bool = False
    weather_mask: bool = False
    resume: bool = False
    wanted: AskedFit = field(default_factory=AskedFit)
    quiet: bool = False
    page: str = ""

    @property
    def name(self) -> str:
        """Return the name of the scene's folder."""
        return scene_name(self.scene)

    def check(self) -> None:
        """See `SceneTask`."""
        from cloudjax_data import open_folder
        from cloudjax_data.output_lock import alone
        from cloudjax_data.whole_files import require_writable
        from cloudjax_fit.checkpoint import checkpoint_in
        from cloudjax_fit.fit_inputs import folder_settings
        from cloudjax_fit.settings import with_options

        from .fit_folder import LOCK

        require_writable(self.folder)
        settings = folder_settings(open_folder(self.scene))
        self.wanted.require_front(with_options(settings, self.options).fit)
        if Path(self.folder).exists():
            with alone(self.folder, LOCK):
                if not self.resume:
                    checkpoint_in(self.folder, "").remove()

    def __call__(self) -> Outcome:
        """See `SceneTask`."""
        if not self.wanted.by_front:
            return self._done(None)
        inputs = self.inputs()
        chosen = self.wanted.by_measure(inputs.target, inputs.settings.fit, self._tell)
        # As if they had been given: a fit of others is another one to go on from.
        knobs = {"rays": chosen.quality.rays, "steps": chosen.quality.steps}
        options = {**self.options, **knobs}
        return replace(self, options=options, wanted=AskedFit())._done(chosen)

    def _done(self, expected: "ExpectedFit | None") -> Outcome:
        from cloudjax_fit.asked import whole_fit
        from cloudjax_fit.checkpoint import checkpoint_in
        from cloudjax_fit.outcome import outcome_of_fit

        asked = self.asked()
        done = whole_fit(self.folder, asked) if self.resume else None
        if done is not None:
            # Of a process that was killed once all was written.
            checkpoint_in(self.folder, asked).remove()
            return outcome_of_fit(self.name, done, page=self.page, kept=True)
        numbers = self._fit(asked, expected)
        return outcome_of_fit(self.name, numbers, page=self.page)

    def asked(self) -> str:
        """Return a digest of what is to be done."""
        from cloudjax_data import open_folder
        from cloudjax_fit.asked import asked_of
        from cloudjax_fit.fit_inputs import folder_settings
        from cloudjax_fit.settings import with_options

        folder = open_folder(self.scene)
        settings = with_options(folder_settings(folder), self.options)
        options = {
            "bands": self.bands,
            "ignore_weather": self.ignore_weather,
            "weather_mask": self.weather_mask,
        }
        return asked_of(folder, settings, options, [self.classes])

    def inputs(self) -> "FitInputs":
        """Read all that the fit needs.

        **Raises:** `DataError` as `read_inputs`.
        """
        from cloudjax_fit.fit_inputs import read_inputs

        return read_inputs(
            self.scene,
            bands=self.bands,
            options=self.options,
            classes=self.classes,
            ignore_weather=self.ignore_weather,
            weather_mask=self.weather_mask,
        )

    def _fit(self, asked: str, expected: "ExpectedFit | None") -> dict[str, Any]:
        from cloudjax_fit.checkpoint import checkpoint_in
        from cloudjax_scenes.trade.stopwatch import Stopwatch

        from .fit_folder import fit_and_write

        inputs, watch = self.inputs(), Stopwatch()
        numbers = fit_and_write(
            inputs.target,
            Path(self.folder),
            inputs.settings.fit,
            overrides=inputs.overrides,
            analysis=inputs.analysis,
            classes=inputs.made_of.known,
            observed=inputs.observed,
            checkpoint=checkpoint_in(self.folder, asked),
            progress=no_progress if self.quiet else fit_progress,
            tell=self._tell,
            watch=watch,
        )
        if expected is not None:
            self._tell(told_time(expected, watch))
        return numbers

    def _tell(self, text: str) -> None:
        if not self.quiet:
            click.echo(text)
