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
import difflib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cloudjax import Scene
from cloudjax_data import DataError
from cloudjax_scenes.cloud_rule import BRIGHT, COLD_K, CloudRule, default_rule
from cloudjax_scenes.sensor_band import nominal_bands
from cloudjax_scenes.weather_analysis import Analysis

from .fitted_scene import DEFAULT_LIGHT, LIGHTS, build_scene, scene_parameters
from .fitting import FitSettings
from .parameters import Parameter, with_overrides
from .targets import BandTarget, Target


_FIT_KEYS = tuple(f.name for f in dataclasses.fields(FitSettings))
# The finest texture has 64 cells per period, of two voxels each at least.
_NUMBERS = [key for key in _FIT_KEYS if key != "light"]
_LEAST = dict.fromkeys(_NUMBERS, 1) | {"resolution": 128, "seed": 0}
_RULE_KEYS = tuple(f.name for f in dataclasses.fields(CloudRule))
# The halves of a rule: its band, its threshold, and the usual thresholds by band.
_HALVES = (
    ("bright_band", "bright_reflectance", BRIGHT),
    ("cold_band", "cold_temperature_k", COLD_K),
)
_PARAMETER_NUMBERS = ("default", "lower", "upper", "spread")


@dataclass(frozen=True)
class Settings:
    """What a user may set, checked and typed.

    **Fields:**

    - `source`: the file to name in an error.
    - `bands`: to use; None for what the scene suggests.
    - `fit`: how a fit is done.
    - `rule`: changes of the default rule for cloud pixels.
    - `parameters`: changes of parameters by name, as `fit` takes them.
    """

    source: str = "the command line"
    bands: tuple[int, ...] | None = None
    fit: FitSettings = field(default_factory=FitSettings)
    rule: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


def read_settings(content: Mapping[str, Any], source: str) -> Settings:
    """Settings from the content of a `scene.toml`.

    **Raises:** `DataError` for a section or key that is unknown or of the wrong type.
    """
    _require_known(content, ("fit", "rule", "parameters"), "section", source)
    sections = {name: _table(content, name, source) for name in content}
    fit = sections.get("fit", {})
    _require_known(fit, (*_FIT_KEYS, "bands"), "key of [fit]", source)
    rule = sections.get("rule", {})
    _require_known(rule, _RULE_KEYS, "key of [rule]", source)
    numbers = {key: value for key, value in fit.items() if key != "bands"}
    _check_fit(numbers, source)
    parameters = sections.get("parameters", {})
    return Settings(
        source=source,
        bands=_bands(fit["bands"], source) if "bands" in fit else None,
        fit=FitSettings(**numbers),
        rule={key: _rule_value(key, value, source) for key, value in rule.items()},
        parameters={
            name: _changes(name, _table(parameters, name, source), source)
            for name in parameters
        },
    )


def with_options(settings: Settings, options: Mapping[str, Any]) -> Settings:
    """Settings with those of the fit replaced that the command line gives.

    **Raises:** `DataError` for a number that is too small.
    """
    given = {name: value for name, value in options.items() if value is not None}
    _check_fit(given, "the command line")
    return replace(settings, fit=replace(settings.fit, **given))


def cloud_rule(settings: Settings, bands: Sequence[int]) -> CloudRule | None:
    """The rule that the settings ask for, None for the default of the scene.

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


def scene_of(
    settings: Settings, target: Target, analysis: Analysis | None = None
) -> tuple[Scene, list[Parameter]]:
    """The scene of a target and its parameters, with the changes of the settings.

    **Raises:** `DataError` for a parameter that no scene has, or for changes that
    contradict each other.
    """
    scene = build_scene(
        target,
        analysis,
        seed=settings.fit.seed,
        steps=settings.fit.steps,
        light=settings.fit.light,
    )
    try:
        return scene, with_overrides(
            scene_parameters(scene, target), overrides_for(settings, target)
        )
    except ValueError as error:
        raise DataError(f"{settings.source}: {error}.") from error


def overrides_for(settings: Settings, target: Target) -> dict[str, Mapping[str, Any]]:
    """Those changes of the settings that concern what a target shows.

    **Raises:** `DataError` for a parameter that no scene has.
    """
    return concerning(settings.parameters, target, settings.source, settings.fit.light)


def concerning(
    changes: Mapping[str, Any], target: Target, source: str, light: str
) -> dict:
    """What is said of parameters that the scene of a target has.

    A name that only other bands would bring in is left out; one that no scene has is an
    error.
    """
    widest = _widest(target)
    known = [name for each in LIGHTS for name in parameter_names(widest, each)]
    _require_known(changes, known, "parameter", source)
    here = parameter_names(target, light)
    return {name: change for name, change in changes.items() if name in here}


def parameter_names(target: Target, light: str = DEFAULT_LIGHT) -> list[str]:
    """The parameters that the scene of a target has."""
    scene = build_scene(target, light=light)
    return [p.name for p in scene_parameters(scene, target)]


def _widest(target: Target) -> Target:
    """A target that shows everything: every band, and so every class of cloud."""
    some = next(iter(target.bands.values()))
    flat = next(iter(target.fractions.values()))
    return replace(
        target,
        bands={number: _any_band(number, some) for number in range(1, 17)},
        fractions={"cirrus": flat, "low_stratus": flat},
    )


def _any_band(number: int, like: BandTarget) -> BandTarget:
    band = nominal_bands()[number]
    return replace(like, number=number, coefficients=band.coefficients())


def _require_known(
    given: Collection[str], known: Collection[str], what: str, source: str
) -> None:
    for name in given:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
            raise DataError(
                f"{source} has an unknown {what}, {name!r}: the nearest known one is "
                f"{near[0]!r}."
            )


def _table(content: Mapping[str, Any], name: str, source: str) -> Mapping[str, Any]:
    value = content[name]
    if not isinstance(value, Mapping):
        raise DataError(f"{source} gives {name} = {value!r}: make it a section.")
    return value


def _bands(value: Any, source: str) -> tuple[int, ...]:
    numbers = value if isinstance(value, list) else [value]
    if not numbers or not all(_is_whole(n) and 1 <= n <= 16 for n in numbers):
        raise DataError(f"{source} gives bands = {value!r}: list numbers from 1 to 16.")
    return tuple(sorted(set(numbers)))


def _check_fit(values: Mapping[str, Any], source: str) -> None:
    for key, value in values.items():
        if key == "light":
            if value not in LIGHTS:
                raise DataError(
                    f"{source} gives light = {value!r}: make it {' or '.join(LIGHTS)}."
                )
        elif not _is_whole(value) or value < _LEAST[key]:
            raise DataError(
                f"{source} gives {key} = {value!r}: make it a whole number of at least "
                f"{_LEAST[key]}."
            )


def _rule_value(key: str, value: Any, source: str) -> Any:
    if not key.endswith("_band"):
        return _number(key, value, source)
    if value is False:
        return None
    if not _is_whole(value) or not 1 <= value <= 16:
        raise DataError(
            f"{source} gives {key} = {value!r}: give the number of a band, or false to "
            "leave this half of the rule out."
        )
    return value


def _changes(name: str, table: Mapping[str, Any], source: str) -> dict[str, Any]:
    _require_known(table, (*_PARAMETER_NUMBERS, "free"), f"key of {name}", source)
    changes = {}
    for key, value in table.items():
        if key != "free":
            changes[key] = _number(f"{name} {key}", value, source)
        elif isinstance(value, bool):
            changes[key] = value
        else:
            raise DataError(
                f"{source} gives {name} free = {value!r}: give true or false."
            )
    if changes.get("spread", 1.0) <= 0:
        raise DataError(f"{source} gives {name} a spread that is not positive.")
    return changes


def _number(what: str, value: Any, source: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DataError(f"{source} gives {what} = {value!r}: give a number.")
    if not np.isfinite(value):
        raise DataError(f"{source} gives {what} = {value!r}: give a finite number.")
    return float(value)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
