"""The names and headers of its files say what a scene folder holds."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime
from os import PathLike
from pathlib import Path
from typing import Any

from cloudjax.toml_table import TomlError, read_toml

from .abi import bands_of, read_band
from .abi_name import SAME_SCAN, AbiName, parse_abi_name
from .abi_scene import AbiScene
from .errors import DataError
from .grib_messages import is_grib
from .manifest import MANIFEST
from .packed import netcdf_file


SETTINGS = "scene.toml"
# What some systems and editors make of its name.
_MEANT = (SETTINGS, f"{SETTINGS}.txt")


@dataclass(frozen=True)
class SceneFolder:
    """A `SceneFolder` names the files of one scene; only names and headers have been
    read.

    **Fields:**

    - `path`: the folder.
    - `bands`: the file of each band: L1b where there is one, else CMI.
    - `products`: the L2 products of the same scan by name: "ACHA", "COD", "ACM" ...,
      with the channel of those that are made of one: "DMW-C14".
    - `weather`: the GRIB files.
    - `settings`: what `scene.toml` holds, empty without one.
    - `platform`, `sector`, `start`: of the scan; None without any ABI file.
    - `ignored`: the files that are none of these; `unreadable`: those of them that
      pretend to be netCDF, or cannot be opened.
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
    unreadable: tuple[Path, ...] = ()

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
    `scene.toml` is not TOML or has another name.
    """
    path = Path(path)
    files = _files(path)
    # Those of macOS that begin with "._" have the names of others, not their content.
    shown = [file for file in files if not file.name.startswith(".")]
    abi, unreadable = _abi_files(shown)
    # Told by content: GFS calls its files gfs.t12z.pgrb2.0p25.f000.
    weather = tuple(
        file for file in shown if not {file} & {*abi, *unreadable} and is_grib(file)
    )
    settings = _settings_files(path)
    used = {*abi, *weather, *settings}
    if not used:
        raise DataError(
            f"{path} holds no ABI file, no GRIB file and no {SETTINGS}"
            f"{_and_what_is_broken(unreadable)}: point at a folder with the ABI files "
            "of one scan."
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
        unreadable=tuple(unreadable),
    )


def _files(path: Path) -> list[Path]:
    if not path.exists():
        raise DataError(f"{path} does not exist: check the path of the scene folder.")
    if not path.is_dir():
        raise DataError(f"{path} is a file: point at the folder that holds it.")
    return sorted(file for file in path.iterdir() if file.is_file())


def _abi_files(files: list[Path]) -> tuple[dict[Path, AbiName], list[Path]]:
    """The files of ABI with what their names say, and files that cannot be opened."""
    abi, unreadable = {}, []
    for file in files:
        try:
            name = _abi_name(file)
        except DataError:
            # A stranger, perhaps: what is needed and cannot be read is missed later.
            unreadable.append(file)
            continue
        if name is not None:
            abi[file] = name
    return abi, unreadable


def _abi_name(file: Path) -> AbiName | None:
    if not _can_be_opened(file):
        raise DataError(f"{file} cannot be opened: change its permissions.")
    if file.suffix.lower() != ".nc":
        return None
    name = parse_abi_name(file.name)
    if name is not None:
        return name
    # renamed files still know what they were
    with netcdf_file(file) as header:
        return parse_abi_name(str(getattr(header, "dataset_name", "")))


def _can_be_opened(file: Path) -> bool:
    try:
        file.open("rb").close()
    except OSError:
        return False
    return True


def _and_what_is_broken(files: list[Path]) -> str:
    if not files:
        return ""
    return f" ({', '.join(file.name for file in files)} cannot be read)"


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
        name = abi[file]
        if name.product == "MCMIP":
            found |= dict.fromkeys(_bands_within(file), file)
        elif name.is_image and name.band is not None:
            found[name.band] = file
    return dict(sorted(found.items()))


def _bands_within(file: Path) -> list[int]:
    """The bands of a file of many; all of them where it does not open."""
    try:
        with netcdf_file(file) as header:
            return bands_of(header)
    except DataError:
        # Reading says what is wrong.
        return list(range(1, 17))


def _products(abi: dict[Path, AbiName]) -> dict[str, Path]:
    return {
        n.product if n.band is None else f"{n.product}-C{n.band:02d}": f
        for f, n in abi.items()
        if not n.is_image
    }


def _settings_files(path: Path) -> list[Path]:
    """The file of settings, if any; one that is meant for it must not go unread."""
    found = [file for file in path.iterdir() if file.name.casefold() in _MEANT]
    exact = path / SETTINGS
    if found and exact not in found:
        raise DataError(
            f"{found[0]} is read by nothing: call it {SETTINGS}, or quite otherwise."
        )
    if exact in found and not exact.is_file():
        raise DataError(f"{exact} is no file of settings: replace or remove it.")
    return [exact] if exact in found else []


def _settings(file: Path) -> dict[str, Any]:
    try:
        return read_toml(file, "settings")
    except TomlError as error:
        raise DataError(str(error)) from error
    except OSError as error:
        raise DataError(f"{file} cannot be read: change its permissions.") from error
