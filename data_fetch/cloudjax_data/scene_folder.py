"""The names and headers of its files say what a scene folder holds."""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime
from os import PathLike
from pathlib import Path
from typing import Any

from .abi import read_band
from .abi_name import AbiName, parse_abi_name
from .abi_scene import SAME_SCAN, AbiScene
from .errors import DataError
from .manifest import MANIFEST
from .packed import netcdf_file


SETTINGS = "scene.toml"


@dataclass(frozen=True)
class SceneFolder:
    """A `SceneFolder` names the files of one scene; only names and headers have been
    read.

    **Fields:**

    - `path`: the folder.
    - `bands`: the file of each band: L1b where there is one, else CMI.
    - `products`: the L2 products of the same scan by name: "ACHA", "COD", "ACM" ...
    - `weather`: the GRIB files.
    - `settings`: what `scene.toml` holds, empty without one.
    - `platform`, `sector`, `start`: of the scan; None without any ABI file.
    - `ignored`: the files that are none of these.
    """

    path: Path
    bands: dict[int, Path] = field(default_factory=dict)
    products: dict[str, Path] = field(default_factory=dict)
    weather: tuple[Path, ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)
    platform: str | None = None
    sector: str | None = None
    start: datetime | None = None
    ignored: tuple[Path, ...] = ()

    def read(
        self,
        bands: Iterable[int] | None = None,
        *,
        keep_conditionally_usable: bool = False,
    ) -> AbiScene:
        """Read bands, all of them by default.

        Raises `DataError` if one is missing or cannot be read.
        """
        wanted = sorted(self.bands if bands is None else set(bands))
        missing = [number for number in wanted if number not in self.bands]
        if missing or not wanted:
            present = ", ".join(map(str, self.bands)) or "none"
            lacking = f"band {', '.join(map(str, missing))}" if missing else "any band"
            raise DataError(
                f"{self.path} does not hold {lacking} (it holds: {present}): ask for "
                "others, or put the ABI files of the same scan there."
            )
        return AbiScene(
            {
                number: read_band(
                    self.bands[number],
                    band=number,
                    keep_conditionally_usable=keep_conditionally_usable,
                )
                for number in wanted
            }
        )


def open_folder(path: str | PathLike[str]) -> SceneFolder:
    """List what a scene folder holds.

    **Raises:** `DataError` if the folder does not exist, is a file or holds nothing of
    use; if its ABI files are of several scans, sectors or satellites; or if its
    `scene.toml` is not TOML.
    """
    path = Path(path)
    files = _files(path)
    abi = {file: name for file in files if (name := _abi_name(file)) is not None}
    weather = tuple(file for file in files if file not in abi and _is_grib(file))
    settings = [file for file in files if file.name == SETTINGS]
    used = {*abi, *weather, *settings}
    if not used:
        raise DataError(
            f"{path} holds no ABI file, no GRIB file and no {SETTINGS}: point at a "
            "folder with the ABI files of one scan."
        )
    first = _only_scan(path, abi)
    return SceneFolder(
        path=path,
        bands=_bands(abi),
        products=_products(abi),
        weather=weather,
        settings=_settings(settings[0]) if settings else {},
        platform=first.platform if first else None,
        sector=first.sector if first else None,
        start=first.start if first else None,
        ignored=tuple(
            file for file in files if file not in used and file.name != MANIFEST
        ),
    )


def _files(path: Path) -> list[Path]:
    if not path.exists():
        raise DataError(f"{path} does not exist: check the path of the scene folder.")
    if not path.is_dir():
        raise DataError(f"{path} is a file: point at the folder that holds it.")
    return sorted(file for file in path.iterdir() if file.is_file())


def _abi_name(file: Path) -> AbiName | None:
    if file.suffix != ".nc":
        return None
    name = parse_abi_name(file.name)
    if name is not None:
        return name
    # renamed files still know what they were
    with netcdf_file(file) as header:
        return parse_abi_name(str(getattr(header, "dataset_name", "")))


def _is_grib(file: Path) -> bool:
    # by content: GFS files are commonly called gfs.t12z.pgrb2.0p25.f000
    with file.open("rb") as stream:
        return stream.read(4) == b"GRIB"


def _only_scan(path: Path, abi: dict[Path, AbiName]) -> AbiName | None:
    """The name with the earliest start, once it is sure that there is one scan."""
    names = sorted(abi.values(), key=lambda name: name.start)
    if not names:
        return None
    first = names[0]
    for name in names:
        same = (name.platform, name.sector) == (first.platform, first.sector)
        if not same or name.start - first.start >= SAME_SCAN:
            raise DataError(
                f"{path} holds several scans ({_scans(names)}): keep the files of one."
            )
    return first


def _scans(names: list[AbiName]) -> str:
    shown = (f"{n.platform} {n.sector} {n.start:%Y-%m-%d %H:%M:%S}" for n in names)
    return "; ".join(dict.fromkeys(shown))


def _bands(abi: dict[Path, AbiName]) -> dict[int, Path]:
    # Later entries win: L1b over CMI, a single band over many, and, the creation time
    # being last in the name, the last reprocessing.
    order = sorted(abi, key=lambda f: (abi[f].level == "L1b", abi[f].band or 0, f.name))
    found = {}
    for file in order:
        if abi[file].product == "MCMIP":
            found |= dict.fromkeys(range(1, 17), file)
        elif abi[file].band is not None:
            found[abi[file].band] = file
    return dict(sorted(found.items()))


def _products(abi: dict[Path, AbiName]) -> dict[str, Path]:
    images = {"Rad", "CMIP", "MCMIP"}
    return {n.product: f for f, n in abi.items() if n.product not in images}


def _settings(file: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DataError(f"{file} is not valid TOML ({error}): correct it.") from error
