"""What a run over a scene folder is asked to do, and whether it has been done."""

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cloudjax
from cloudjax_data import SceneFolder

from .fit_files import FILES, NUMBERS
from .fit_result import CONVERGED, NOT_CONVERGED
from .settings import Settings


def asked_of(
    folder: SceneFolder,
    settings: Settings,
    options: Mapping[str, Any],
    files: Iterable[str | os.PathLike[str] | None] = (),
) -> str:
    """Return a digest of all that decides the results of a run over a scene folder.

    It changes with the content of a file, and not with its name or its time.

    **Arguments:**

    - `settings`: of the folder, with those of the command line.
    - `options`: whatever else was chosen, by name: plain values.
    - `files`: that are read besides those of the folder; None is none.

    **Raises:** `OSError` for a file that cannot be read.
    """
    read = [*folder.bands.values(), *folder.weather]
    if settings.classes is not None:
        read.append(folder.path / settings.classes)
    read += [Path(file) for file in files if file is not None]
    asked = {
        "cloudjax": cloudjax.__version__,
        "fit": asdict(settings.fit),
        "bands": settings.bands,
        "rule": dict(settings.rule),
        "parameters": dict(settings.parameters),
        "options": dict(options),
        "files": [_digest(file) for file in read],
    }
    text = json.dumps(asked, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def whole_fit(folder: str | os.PathLike[str], asked: str) -> dict[str, Any] | None:
    """Read the `fit.json` of a fit that has come to its end, None where there is none.

    **Arguments:** `asked`: the digest of what the fit must have been asked to do.
    """
    folder = Path(folder)
    if not all((folder / name).is_file() for name in FILES):
        return None
    try:
        numbers = json.loads((folder / NUMBERS).read_text(encoding="utf-8"))
        ended = numbers["status"] in (CONVERGED, NOT_CONVERGED)
        return numbers if ended and numbers["asked"] == asked else None
    except (ValueError, KeyError, TypeError):
        # Of another version or another program: what is asked for is not there.
        return None


def _digest(file: Path) -> str:
    with file.open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()
