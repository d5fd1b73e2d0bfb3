"""What a scene folder holds, and what a run of it would use, in words."""

from collections.abc import Iterator, Sequence

from cloudjax.air.clear_air import LEAST_DEPTH
from cloudjax.air.gases import scattering_depth, standard_depth
from cloudjax_data import (
    AbiBand,
    DataError,
    ReflectiveCalibration,
    SceneFolder,
    check_time,
    read_band,
    read_weather,
)
from cloudjax_fit.fitted_scene import LIGHTS
from cloudjax_fit.scene_run import Run, prepare
from cloudjax_fit.settings import scene_of
from cloudjax_scenes.daylight import is_day, sun_heights_deg


Row = tuple[str, str]


def folder_rows(folder: SceneFolder) -> Iterator[Row]:
    """What the folder holds and what is missing, as labels and sentences.

    **Raises:** `DataError` if a band cannot be read.
    """
    bands = {n: read_band(file, band=n) for n, file in folder.bands.items()}
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
    missing = sorted(set(range(1, 17)) - set(bands))
    yield "missing", f"bands {_listed(missing)}" if missing else "no band"
    yield "products", ", ".join(sorted(folder.products)) or "none"
    yield from _weather_rows(folder, some)
    yield "settings", ", ".join(folder.settings) or "none (no scene.toml)"
    if folder.ignored:
        yield "ignored", ", ".join(file.name for file in folder.ignored)


def run_rows(
    folder: SceneFolder,
    bands: Sequence[int] | None,
    ignore_weather: bool,
    light: str | None = None,
) -> Iterator[Row]:
    """Which parts of the model a run would use, and why; or why it cannot be."""
    try:
        run = prepare(
            folder.path,
            bands=bands,
            options={"light": light},
            ignore_weather=ignore_weather,
        )
    except DataError as error:
        yield "no run", str(error)
        return
    target = run.target
    yield "bands", _listed(target.bands)
    yield (
        "cloud pixels",
        f"{target.rule} ({target.cloud_fraction:.1%} of the good ones)",
    )
    sunlit, emissive = (
        [b.number for b in bands] for bands in (target.sunlit, target.emissive)
    )
    chosen = run.settings.fit.light
    yield "sunlight", _use(sunlit, "reflective band", f", {chosen} light")
    yield "emission", _use(emissive, "thermal band")
    if emissive:
        yield "thermal scattering", _thermal_scattering(chosen)
    yield "shadows", "left out: renders have them, fits none"
    yield from _layer_rows(run)
    yield "advection", _advection(run)
    yield "surface", "radiances of the clear pixels around, as seen from space"
    profile = (
        f"the mean profile of {run.analysis.cube.path.name}"
        if run.analysis
        else "the standard atmosphere"
    )
    yield "temperature", profile
    yield from _air_rows(run, profile)


def _air_rows(run: Run, profile: str) -> Iterator[Row]:
    light = run.settings.fit.light
    scene, _ = scene_of(run.settings, run.target, run.analysis)
    air = scene.air
    if air is None:
        yield (
            "air",
            f"left out: a path and a gain of each band stand for it in {light} light",
        )
        return
    yield "air", f"above each cloud, with the humidity of {profile}"
    bands = tuple(run.target.bands)
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


def _layer_rows(run: Run) -> Iterator[Row]:
    target = run.target
    for name, fraction in target.fractions.items():
        yield f"layer {name}", f"covers {fraction.mean():.1%} of the area"
    if "cirrus" not in target.fractions:
        yield "layer cirrus", "left out: no window band tells high cloud from low"


def _advection(run: Run) -> str:
    if run.analysis is None:
        return "left out: no weather file gives winds"
    if not run.analysis.cube.is_global:
        return "left out: the winds of a regional analysis do not reach far enough"
    return f"{run.analysis.hours:g} hours of the winds in {run.analysis.cube.path.name}"


def _sun(band: AbiBand) -> str:
    low, high = heights = sun_heights_deg(band)
    hour = "day" if is_day(heights) else "night, reflective bands see no cloud"
    return f"{hour}: {low:.0f} to {high:.0f} deg above the horizon"


def _band(band: AbiBand) -> str:
    rows, columns = band.grid.shape
    km = band.grid.step_rad * band.grid.perspective_height_m / 1000
    kind = "reflective" if _is_reflective(band) else "thermal"
    return (
        f"{band.wavelength_um:5.2f} µm {kind:<10} {rows} x {columns} at {km:.1f} km, "
        f"{band.good.mean():.2%} good"
    )


def _is_reflective(band: AbiBand) -> bool:
    return isinstance(band.calibration, ReflectiveCalibration)


def _weather_rows(folder: SceneFolder, band: AbiBand | None) -> Iterator[Row]:
    if not folder.weather:
        yield "weather", "none: where clouds may stand comes from the imagery itself"
    for file in folder.weather:
        cube = read_weather(file)
        text = f"{file.name}, valid {cube.valid_time:%Y-%m-%d %H:%M} UTC"
        if band is None:
            yield "weather", text
            continue
        hours = (cube.valid_time - band.time).total_seconds() / 3600
        try:
            check_time(band.time, cube)
            verdict = "near enough"
        except DataError:
            verdict = "too far: runs refuse it unless told to ignore the weather"
        yield "weather", f"{text}, {hours:+.1f} hours from the imagery: {verdict}"


def _thermal_scattering(light: str) -> str:
    if LIGHTS[light].emission() is None:
        return f"left out: clouds only absorb in {light} light"
    return f"by slabs of the particles, in {light} light"


def _use(numbers: Sequence[int], kind: str, how: str = "") -> str:
    return f"for bands {_listed(numbers)}{how}" if numbers else f"left out: no {kind}"


def _listed(numbers) -> str:
    return ", ".join(map(str, numbers))
