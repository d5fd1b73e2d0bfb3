"""Files of classes of cloud are read: built-in ones, a user's, those of a fit."""

import importlib.resources
import os
from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any, get_args

from cloudjax.toml_table import (
    ANY_NUMBER,
    FLAG,
    LIST,
    NUMBER,
    NUMBERS,
    TABLE,
    TEXT,
    Kind,
    TomlError,
    checked,
    parse_toml,
    read_toml,
)
from cloudjax.weather.evidence import Evidence, Window
from cloudjax.weather.masks import Conditions

from .class_parameters import Prior
from .classes import ClassTexture, CloudClass, ImageryRule, Phase
from .ladder import Ladder
from .noise import Gaussian, InvertedWorley, Noise, Perlin


# What a file may hold beside classes: a fit writes there what else it has found.
NOT_CLASSES = ("light_strategy", "light", "air")
_NOISES: dict[str, Noise] = {
    "gaussian": Gaussian(),
    "perlin": Perlin(),
    "inverted_worley": InvertedWorley(),
}
_PHASES = get_args(Phase)
_NUMBERS = tuple(
    f.name for f in fields(CloudClass) if f.type is float and f.default is MISSING
)
# Numbers that a file may leave out, with what they are then.
_DEFAULTS = {
    f.name: f.default
    for f in fields(CloudClass)
    if f.type is float and f.default is not MISSING
}
_CLASS: dict[str, Kind] = {
    **dict.fromkeys(_NUMBERS, NUMBER),
    "particles": Kind(
        " or ".join(f'"{phase}"' for phase in _PHASES), lambda value: value in _PHASES
    ),
    "conditions": TABLE,
    "textures": LIST,
}
_OPTIONAL = {
    "infrared_ratio": NUMBER,
    **dict.fromkeys(_DEFAULTS, NUMBER),
    "imagery": TABLE,
    "priors": TABLE,
}
_CONDITIONS = dict.fromkeys(
    (name for name in Conditions.__dataclass_fields__ if name != "evidence"), ANY_NUMBER
)
_WINDOW: dict[str, Kind] = dict.fromkeys(("above", "below", "width"), ANY_NUMBER)
_IMAGERY = dict.fromkeys((f.name for f in fields(ImageryRule)), NUMBER)
_LADDER = ("longest_m", "shortest_m")
_SHAPE = ("weight", "persistence", "displacement_hours")
_TEXTURE = {"noise": TEXT, **dict.fromkeys((*_LADDER, *_SHAPE), NUMBER)}
_OF_TEXTURE = {"name": TEXT, "gains": NUMBERS}
_PRIOR = {"lower": NUMBER, "upper": NUMBER, "spread": NUMBER, "log": FLAG, "free": FLAG}


def cloud_classes() -> dict[str, CloudClass]:
    """Return the four classes of Schinder et al. (2024), Table 1, by name."""
    return _built_in("classes.toml")


def weather_classes() -> dict[str, CloudClass]:
    """Return the classes of renders over weather, whose cover an analysis tells."""
    return _built_in("weather_classes.toml")


def imagery_classes(*, paper_light: bool = False) -> dict[str, CloudClass]:
    """Return the classes that fits to imagery start from, the highest first.

    **Arguments:** `paper_light`: those for the two-flux light of the paper, whose
    clouds are thicker and have wider priors.
    """
    return _built_in(
        "imagery_classes_paper_light.toml" if paper_light else "imagery_classes.toml"
    )


def load_classes(path: str | os.PathLike[str]) -> dict[str, CloudClass]:
    """Read classes of cloud from a TOML file laid out as `classes.toml`.

    The `parameters.toml` of a fit is such a file.

    **Raises:** `TomlError`, a `ValueError`, that names the file, the class and the key
    where the file is absent or a key is unknown, missing, of the wrong type or out of
    range.
    """
    return classes_from(read_toml(path, "a file of classes of cloud"), str(path))


def classes_from(content: Mapping[str, Any], source: str) -> dict[str, CloudClass]:
    """Make classes from the content of a file, by name; `source` is for messages.

    **Raises:** `TomlError` as `load_classes`.
    """
    classes = {
        name: _class(name, table, f"{source}: class {name}")
        for name, table in content.items()
        if name not in NOT_CLASSES
    }
    if not classes:
        raise TomlError(f"{source} holds no class of cloud: write one at least.")
    return classes


def class_table(one: CloudClass) -> dict[str, Any]:
    """Return a class as the table that a file of classes holds."""
    table: dict[str, Any] = {key: getattr(one, key) for key in _NUMBERS}
    table["particles"] = one.particles
    if one.infrared_ratio is not None:
        table["infrared_ratio"] = one.infrared_ratio
    for key, usual in _DEFAULTS.items():
        if getattr(one, key) != usual:
            table[key] = getattr(one, key)
    conditions: dict[str, Any] = {
        key: float(getattr(one.conditions, key)) for key in _CONDITIONS
    }
    if one.conditions.evidence is not None:
        conditions["evidence"] = _evidence_table(one.conditions.evidence)
    table["conditions"] = conditions
    if one.imagery is not None:
        rule = {key: getattr(one.imagery, key) for key in _IMAGERY}
        table["imagery"] = {k: v for k, v in rule.items() if v is not None}
    if one.priors:
        table["priors"] = {
            key: {k: getattr(prior, k) for k in _PRIOR}
            for key, prior in one.priors.items()
        }
    table["textures"] = [_texture_table(texture) for texture in one.textures]
    return table


def _evidence_table(evidence: Evidence) -> dict[str, Any]:
    return {
        "layer": evidence.layer,
        **({"claims": evidence.claims} if evidence.claims else {}),
        "windows": [
            {
                "quantity": window.quantity,
                **{key: getattr(window, key) for key in _WINDOW},
            }
            for window in evidence.windows
        ],
    }


def _texture_table(texture: ClassTexture) -> dict[str, Any]:
    ladder = texture.ladder
    (noise,) = (name for name, noise in _NOISES.items() if noise == ladder.noise)
    return {
        **({"name": texture.name} if texture.name else {}),
        "noise": noise,
        **{key: getattr(ladder, key) for key in _LADDER},
        **{key: getattr(texture, key) for key in _SHAPE},
        **({"gains": list(texture.gains)} if texture.gains else {}),
    }


def _built_in(name: str) -> dict[str, CloudClass]:
    file = importlib.resources.files("cloudjax.clouds").joinpath(name)
    return classes_from(parse_toml(file.read_text(encoding="utf-8"), name), name)


def _class(name: str, table: Any, where: str) -> CloudClass:
    given = checked(table, _CLASS, _OPTIONAL, where)
    if not given["textures"]:
        raise TomlError(f"{where} has no textures: add [[{name}.textures]].")
    parts = {
        "conditions": _conditions(given["conditions"], f"{where}, conditions"),
        "textures": tuple(
            _texture(one, f"{where}, texture {i}")
            for i, one in enumerate(given["textures"], start=1)
        ),
        "priors": {
            key: _prior(one, f"{where}, prior of {key}")
            for key, one in given.get("priors", {}).items()
        },
    }
    if "imagery" in given:
        rule = checked(given["imagery"], {}, _IMAGERY, f"{where}, imagery")
        parts["imagery"] = ImageryRule(**rule)
    return _made(CloudClass, {"name": name, **given, **parts}, where)


def _conditions(table: Any, where: str) -> Conditions:
    given = checked(table, _CONDITIONS, {"evidence": TABLE}, where)
    if "evidence" in given:
        given["evidence"] = _evidence(given["evidence"], f"{where}, evidence")
    return _made(Conditions, given, where)


def _evidence(table: Any, where: str) -> Evidence:
    given = checked(table, {"layer": TEXT}, {"claims": TEXT, "windows": LIST}, where)
    windows = [
        checked(one, {"quantity": TEXT}, _WINDOW, f"{where}, window {i}")
        for i, one in enumerate(given.pop("windows", ()), start=1)
    ]
    made = tuple(
        _made(Window, one, f"{where}, window {i}")
        for i, one in enumerate(windows, start=1)
    )
    return _made(Evidence, {**given, "windows": made}, where)


def _prior(table: Any, where: str) -> Prior:
    needed = {key: _PRIOR[key] for key in ("lower", "upper", "spread")}
    optional = {key: _PRIOR[key] for key in ("log", "free")}
    return _made(Prior, checked(table, needed, optional, where), where)


def _texture(table: Any, where: str) -> ClassTexture:
    given = checked(table, _TEXTURE, _OF_TEXTURE, where)
    if given["noise"] not in _NOISES:
        kinds = " or ".join(f'"{kind}"' for kind in _NOISES)
        raise TomlError(f"{where}: noise must be {kinds}.")
    span = {key: given.pop(key) for key in _LADDER}
    ladder = _made(Ladder, {"noise": _NOISES[given.pop("noise")], **span}, where)
    gains = tuple(given.pop("gains", ()))
    return _made(ClassTexture, {"ladder": ladder, "gains": gains, **given}, where)


def _made(kind: Any, values: Mapping[str, Any], where: str) -> Any:
    """Make an object, and say where the values are from if it refuses them."""
    try:
        return kind(**values)
    except ValueError as error:
        raise TomlError(f"{where}: {error}") from error
