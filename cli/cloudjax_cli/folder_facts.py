"""What a scene folder holds, and what a run of it would use, in words."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from cloudjax import Air
from cloudjax.air.clear_air import LEAST_DEPTH
from cloudjax.air.gases import scattering_depth, standard_depth
from cloudjax_data import (
    AbiBand,
    DataError,
    ReflectiveCalibration,
    SceneFolder,
    check_time,
    read_band,
    read_retrieval,
    read_weather,
)
from cloudjax_data.abi_retrieval import holds_retrieval
from cloudjax_fit.cautions import missing_share
from cloudjax_fit.fit_inputs import FitInputs, read_inputs
from cloudjax_fit.targets import Target
from cloudjax_scenes.daylight import shows_sunlit_clouds, sun_heights_deg
from cloudjax_scenes.imagery_scene import SceneFromImagery
from cloudjax_scenes.lights import Light
from cloudjax_scenes.weather_analysis import share_in_words
from cloudjax_scenes.weather_cover import held_share


Row = tuple[str, str]


def folder_rows(folder: SceneFolder) -> Iterator[Row]:
    """What the folder holds and what is missing, as labels and sentences.

    **Raises:** `DataError` if no band of several can be read.
    """
    bands, broken = _readable_bands(folder)
    # The last one, for the others may be of a finer and slower grid.
    some = next(reversed(bands.values()), None)
    yield "scene", str(folder.path)
    if some is not None:
        yield (
            "satellite",
            f"{some.platform} ({some.orbital_slot}), sector {some.sector}",
        )
        yield "time", f"{some.time:%Y-%m-%d %H:%M:%S} UTC"
        yield "sun", _sun(some)
    for band in bands.values():
        yield f"band {band.number}", _band(band)
    for number, error in broken.items():
        yield f"band {number}", f"cannot be used: {error}"
    for note in dict.fromkeys(note for band in bands.values() for note in band.notes):
        yield "mind", note
    missing = sorted(set(range(1, 17)) - set(bands) - set(broken))
    yield "missing", f"bands {_listed(missing)}" if missing else "no band"
    yield "products", ", ".join(sorted(folder.products)) or "none"
    if holds_retrieval(folder):
        yield "retrieval", _retrieval(folder)
    yield from _weather_rows(folder, some)
    yield "settings", ", ".join(folder.settings) or "none (no scene.toml)"
    strangers = [file for file in folder.ignored if file not in folder.unreadable]
    if strangers:
        yield "ignored", ", ".join(file.name for file in strangers)
    if folder.unreadable:
        names = ", ".join(file.name for file in folder.unreadable)
        yield "unreadable", f"{names}: left alone"


def _retrieval(folder: SceneFolder) -> str:
    try:
        found = read_retrieval(folder.path)
    except DataError as error:
        return f"cannot be used: {error}"
    rows, columns = found.grid.shape
    share = found.cloudy.mean()
    return (
        f"clouds for render SENSOR --retrieval: {rows} x {columns} pixels, "
        f"{share:.0%} cloudy, {found.unknown.mean():.0%} unknown, "
        f"{found.time:%Y-%m-%d %H:%M} UTC"
    )


def _readable_bands(
    folder: SceneFolder,
) -> tuple[dict[int, AbiBand], dict[int, DataError]]:
    bands, broken = {}, {}
    for number, file in folder.bands.items():
        try:
            bands[number] = read_band(file, band=number)
        except DataError as error:
            broken[number] = error
    if broken and not bands:
        raise next(iter(broken.values()))
    return bands, broken


def run_rows(
    folder: SceneFolder,
    bands: Sequence[int] | None,
    ignore_weather: bool,
    light: str | None = None,
) -> Iterator[Row]:
    """Which parts of the model a run would use, and why; or why it cannot be."""
    try:
        inputs = read_inputs(
            folder.path,
            bands=bands,
            options={"light": light},
            ignore_weather=ignore_weather,
        )
    except DataError as error:
        yield "no run", str(error)
        return
    made_of = inputs.made_of
    yield from _imagery_rows(inputs.target)
    yield from _light_rows(made_of)
    yield from _layer_rows(inputs)
    yield "advection", _advection(made_of)
    yield "surface", _surface(inputs.target)
    profile = (
        f"the mean profile of {inputs.analysis.cube.path.name}"
        if inputs.analysis
        else "the standard atmosphere"
    )
    yield "temperature", profile
    for note in made_of.notes:
        yield "mind", note
    yield from _air_rows(made_of, profile)


def _imagery_rows(target: Target) -> Iterator[Row]:
    imagery = target.imagery
    yield "bands", _listed(imagery.bands)
    yield (
        "cloud pixels",
        f"{imagery.rule} ({target.cloud_fraction:.1%} of the good ones)",
    )
    missing = missing_share(target, imagery.grid.sees_the_earth())
    yield "missing pixels", f"{missing:.1%} of those that see the Earth"
    for note in imagery.notes:
        yield "mind", note


def _light_rows(made_of: SceneFromImagery) -> Iterator[Row]:
    imagery, chosen = made_of.imagery, made_of.light
    sunlit, emissive = (
        [b.number for b in bands] for bands in (imagery.sunlit, imagery.emissive)
    )
    yield "sunlight", _use(sunlit, "reflective band", f", {chosen.name} light")
    yield "emission", _use(emissive, "thermal band")
    if emissive:
        yield "thermal scattering", _thermal_scattering(chosen)
    yield "shadows", "left out: renders have them, fits none"


def _surface(target: Target) -> str:
    if target.cloud_fraction == 1:
        return "the table of land and sea, for no pixel is clear"
    return "radiances of the clear pixels around, as seen from space"


def _air_rows(made_of: SceneFromImagery, profile: str) -> Iterator[Row]:
    if not made_of.light.air:
        yield (
            "air",
            "left out: a path and a gain of each band stand for it in "
            f"{made_of.light.name} light",
        )
        return
    yield "air", f"above each cloud, with the humidity of {profile}"
    bands = tuple(made_of.imagery.bands)
    air = Air.of_bands(bands)
    parts = (
        ("Rayleigh", air.scattered, scattering_depth(bands)),
        ("gases", air.absorbed, standard_depth(bands)),
    )
    for i, band in enumerate(bands):
        words = [_part(kind, band in used, depth[i]) for kind, used, depth in parts]
        yield f"air of C{band:02d}", ", ".join(words)


def _part(kind: str, used: bool, depth: float) -> str:
    if used:
        return f"{kind} of optical depth {depth:.3f}"
    return f"{kind} left out ({depth:.4f} is less than {LEAST_DEPTH:g})"


def _layer_rows(inputs: FitInputs) -> Iterator[Row]:
    made_of = inputs.made_of
    fractions = made_of.imagery.fractions
    for name, fraction in fractions.items():
        yield f"layer {name}", f"covers {fraction.mean():.1%} of the area"
    for name, one in made_of.available.items():
        if name in fractions:
            continue
        rule = one.imagery
        if rule is None:
            why = "its class has no rule in imagery"
        elif made_of.imagery.rule.cold_band is None and rule.colder_than_standard_at_m:
            why = "no window band tells high cloud from low"
        else:
            why = "no cloud pixel is of its class"
        yield f"layer {name}", f"left out: {why}"


def _advection(made_of: SceneFromImagery) -> str:
    analysis = made_of.analysis
    if analysis is None:
        return "left out: no weather file gives winds"
    if not analysis.cube.is_global:
        return "left out: the winds of a regional analysis do not reach far enough"
    every = {t.displacement_hours for one in made_of.classes for t in one.textures}
    hours = ", ".join(f"{hours:g}" for hours in sorted(every))
    return f"{hours} hours of the winds in {analysis.cube.path.name}"


def _sun(band: AbiBand) -> str:
    low, high = heights = sun_heights_deg(band.grid, band.time)
    hour = (
        "day"
        if shows_sunlit_clouds(heights)
        else "night, reflective bands see no cloud"
    )
    return f"{hour}: {low:.0f} to {high:.0f} deg above the horizon"


def _band(band: AbiBand) -> str:
    rows, columns = band.grid.shape
    km = band.grid.step_rad * band.grid.perspective_height_m / 1000
    kind = "reflective" if _is_reflective(band) else "thermal"
    return (
        f"{band.wavelength_um:5.2f} µm {kind:<10} {rows} x {columns} at {km:.1f} km, "
        f"{_good_share(band):.2%} good"
    )


def _good_share(band: AbiBand) -> float:
    """Of the pixels that see the Earth."""
    return float(band.good.sum() / max(band.grid.sees_the_earth().sum(), 1))


def _is_reflective(band: AbiBand) -> bool:
    return isinstance(band.calibration, ReflectiveCalibration)


def _weather_rows(folder: SceneFolder, band: AbiBand | None) -> Iterator[Row]:
    if not folder.weather:
        yield "weather", "none: where clouds may stand comes from the imagery itself"
    for file in folder.weather:
        yield "weather", _weather(file, band)


def _weather(file: Path, band: AbiBand | None) -> str:
    try:
        cube = read_weather(file)
    except DataError as error:
        return f"{file.name} cannot be used: {error}"
    text = f"{file.name}, valid {cube.valid_time:%Y-%m-%d %H:%M} UTC"
    if band is None:
        return f"{text}, of {cube.extent}"
    hours = (cube.valid_time - band.time).total_seconds() / 3600
    text = f"{text}, {hours:+.1f} hours from the imagery"
    try:
        check_time(band.time, cube)
    except DataError:
        return f"{text}: too far, runs refuse it unless told to ignore the weather"
    try:
        share = share_in_words(held_share(cube, band.grid))
    except DataError as error:
        return f"{text}: runs refuse it, {error}"
    return f"{text}: near enough, and holds {share} of the scene"


def _thermal_scattering(light: Light) -> str:
    if light.emission is None:
        return f"left out: clouds only absorb in {light.name} light"
    return f"by slabs of the particles, in {light.name} light"


def _use(numbers: Sequence[int], kind: str, how: str = "") -> str:
    return f"for bands {_listed(numbers)}{how}" if numbers else f"left out: no {kind}"


def _listed(numbers) -> str:
    return ", ".join(map(str, numbers))
