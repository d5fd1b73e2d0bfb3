"""The settings of a run: `scene.toml` in the scene folder, then the command line.

    [fit]
    bands = [1, 3, 13]
    rays = 4096

    [rule]
    cold_temperature_k = 255.0

    [parameters."low_stratus.threshold"]
    default = 0.3
    free = false

A key that nothing reads is an error: it is nearly always a misspelt one.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cloudjax.toml_table import (
    FLAG,
    NUMBER,
    POSITIVE,
    TABLE,
    TEXT,
    Kind,
    TomlError,
    checked,
    is_whole,
    one_of,
    require_known,
    within,
)
from cloudjax_data import DataError
from cloudjax_scenes.cloud_rule import BRIGHT, COLD_K, CloudRule, default_rule
from cloudjax_scenes.data_errors import data_errors
from cloudjax_scenes.imagery_scene import SceneFromImagery
from cloudjax_scenes.lights import LIGHTS

from .fit_settings import QUALITIES, STATISTICS, FitSettings
from .parameters import Parameter, unbounded_of, with_overrides
from .scene_parameters import known_names, scene_parameters


# Earlier releases had textures with voxels to choose.
_NO_LONGER = ("resolution",)
_FIT = {
    "rays": within(1, 10**9),
    "steps": within(1, 10**4),
    "starts": within(1, 10**4),
    "max_steps": within(1, 10**6),
    "seed": within(0, 2**62),
    "statistics": one_of(list(STATISTICS)),
    "light": one_of(list(LIGHTS)),
}
_QUALITY = one_of(list(QUALITIES))
_BAND = Kind("a whole number from 1 to 16", lambda n: is_whole(n) and 1 <= n <= 16)
_BAND_OR_NONE = Kind(
    "the number of a band, or false to leave this half of the rule out", _BAND.holds
)
_RULE_KEYS = tuple(f.name for f in dataclasses.fields(CloudRule))
# The halves of a rule: its band, its threshold, and the usual thresholds by band.
_HALVES = (
    ("bright_band", "bright_reflectance", BRIGHT),
    ("cold_band", "cold_temperature_k", COLD_K),
)
_PARAMETER = {
    "default": NUMBER,
    "lower": NUMBER,
    "upper": NUMBER,
    "spread": POSITIVE,
    "free": FLAG,
}


@dataclass(frozen=True)
class Settings:
    """`Settings` are what a user may set, checked and typed.

    **Fields:**

    - `source`: the file to name in an error.
    - `bands`: to use; None for what the scene suggests.
    - `classes`: a file of classes of cloud, in the scene folder; None for those of the
      light.
    - `fit`: how a fit is done.
    - `rule`: changes of the default rule for cloud pixels.
    - `parameters`: changes of parameters by name, as `fit` takes them.
    """

    source: str = "the command line"
    bands: tuple[int, ...] | None = None
    classes: str | None = None
    fit: FitSettings = field(default_factory=FitSettings)
    rule: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


@data_errors()
def read_settings(content: Mapping[str, Any], source: str) -> Settings:
    """Read settings from the content of a `scene.toml`.

    **Raises:** `DataError` for a section or key that is unknown or of the wrong type.
    """
    require_known(content, ("fit", "rule", "parameters"), "section", source)
    sections = {name: _table(content, name, source) for name in content}
    fit = dict(sections.get("fit", {}))
    known = (*_FIT, *_NO_LONGER, "bands", "classes")
    require_known(fit, known, "key of [fit]", source)
    fit = {key: value for key, value in fit.items() if key not in _NO_LONGER}
    bands, classes = fit.pop("bands", None), fit.pop("classes", None)
    rule = sections.get("rule", {})
    require_known(rule, _RULE_KEYS, "key of [rule]", source)
    parameters = sections.get("parameters", {})
    return Settings(
        source=source,
        bands=None if bands is None else _bands(bands, source),
        classes=None if classes is None else TEXT.check(classes, "classes", source),
        fit=FitSettings(**checked(fit, {}, _FIT, source)),
        rule={key: _rule_value(key, value, source) for key, value in rule.items()},
        parameters={
            name: _changes(name, _table(parameters, name, source), source)
            for name in parameters
        },
    )


@data_errors()
def with_options(settings: Settings, options: Mapping[str, Any]) -> Settings:
    """Return settings with those of the fit replaced that the command line gives.

    `quality` stands for rays and steps.

    **Raises:** `DataError` for a number that is too small, and for a quality beside
    what it stands for.
    """
    given = {name: value for name, value in options.items() if value is not None}
    quality = given.pop("quality", None)
    given = checked(given, {}, _FIT, "the command line")
    if quality is not None:
        given |= _of_quality(quality, given)
    return replace(settings, fit=replace(settings.fit, **given))


def _of_quality(quality: Any, given: Mapping[str, Any]) -> Mapping[str, int]:
    chosen = _QUALITY.check(quality, "quality", "the command line")
    for name in QUALITIES[chosen]:
        if name in given:
            raise DataError(f"--quality and --{name} both choose: give one.")
    return QUALITIES[chosen]


def cloud_rule(settings: Settings, bands: Sequence[int]) -> CloudRule | None:
    """Return the rule that the settings ask for, None for the default of the scene.

    **Raises:** `DataError` if the rule needs a band that is not used, or a threshold
    for which there is no default.
    """
    if not settings.rule:
        return None
    asked = _usual_rule(bands) | dict(settings.rule)
    for half in _HALVES:
        asked |= _threshold(settings, asked[half[0]], bands, half)
    if asked["bright_band"] is None and asked["cold_band"] is None:
        raise DataError(
            f"{settings.source} leaves no band that tells cloud from surface: set "
            "bright_band or cold_band in [rule]."
        )
    return CloudRule(**asked)


def _usual_rule(bands: Sequence[int]) -> dict[str, Any]:
    try:
        day = any(band in BRIGHT for band in bands)
        return dataclasses.asdict(default_rule(list(bands), day=day))
    except ValueError:
        return dataclasses.asdict(CloudRule(None, np.inf, None, -np.inf))


def _threshold(settings, band, bands, half) -> dict[str, float]:
    """The threshold that comes with a band that was chosen by hand."""
    name, key, usual = half
    if band is None or name not in settings.rule:
        return {}
    if band not in bands:
        raise DataError(
            f"{settings.source} sets {name} = {band}, which is not among the bands "
            f"{', '.join(map(str, bands))} of the run: use one of them or add it."
        )
    if key in settings.rule:
        return {}
    if band not in usual:
        raise DataError(
            f"{settings.source} sets {name} = {band}, for which there is no usual "
            f"threshold: set {key} too."
        )
    return {key: usual[band]}


def changed_parameters(
    settings: Settings, made_of: SceneFromImagery, *, to_fit: bool = True
) -> list[Parameter]:
    """Return the parameters of a scene, with the changes of the settings.

    **Arguments:** `to_fit`: none may lie on a bound, from which no solver gets away.

    **Raises:** `DataError` for a parameter that no scene has, or for changes that
    contradict each other.
    """
    changes = overrides_for(settings, made_of)
    try:
        parameters = with_overrides(scene_parameters(made_of), changes)
        if to_fit:
            unbounded_of(parameters)
        return parameters
    except ValueError as error:
        raise DataError(f"{settings.source}: {error}.") from error


def overrides_for(
    settings: Settings, made_of: SceneFromImagery
) -> dict[str, Mapping[str, Any]]:
    """Return those changes of the settings that concern what a scene shows.

    **Raises:** `DataError` for a parameter that no scene has.
    """
    return concerning(settings.parameters, made_of, settings.source)


@data_errors()
def concerning(
    changes: Mapping[str, Any], made_of: SceneFromImagery, source: str
) -> dict[str, Any]:
    """Return what is said of parameters that a scene has.

    A name that only other bands, lights or clouds would bring in is left out; one that
    no scene has is an error.
    """
    classes = [*made_of.available.values()]
    for light in LIGHTS.values():
        classes += light.imagery_classes().values()
    require_known(changes, known_names(classes), "parameter", source)
    here = [parameter.name for parameter in scene_parameters(made_of)]
    return {name: change for name, change in changes.items() if name in here}


def _table(content: Mapping[str, Any], name: str, source: str) -> Mapping[str, Any]:
    if not TABLE.holds(content[name]):
        raise TomlError(
            f"{source} gives {name} = {content[name]!r}: make it a section."
        )
    return content[name]


def _bands(value: Any, source: str) -> tuple[int, ...]:
    numbers = value if isinstance(value, list) else [value]
    if not numbers or not all(_BAND.holds(n) for n in numbers):
        raise TomlError(f"{source} gives bands = {value!r}: list numbers from 1 to 16.")
    return tuple(sorted(set(numbers)))


def _rule_value(key: str, value: Any, source: str) -> Any:
    if not key.endswith("_band"):
        return NUMBER.check(value, key, source)
    return None if value is False else _BAND_OR_NONE.check(value, key, source)


def _changes(name: str, table: Mapping[str, Any], source: str) -> dict[str, Any]:
    return checked(table, {}, _PARAMETER, f"{source}, parameter {name},")
