"""The radiances of a scene become its clouds by class, and the ground below them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from cloudjax import (
    Band,
    CloudClass,
    FixedGrid,
    LatLonGrid,
    imagery_classes,
)
from cloudjax.geometry.geodesy import up
from cloudjax_data import (
    AbiBand,
    AbiScene,
    DataError,
    EmissiveCalibration,
    ReflectiveCalibration,
    WeatherCube,
    earth_sun_distance_au,
    sun_direction,
)
from cloudjax_data.plain_path import printable

from .abi_bands import band_of_file
from .assumed_ground import assumed_background
from .background import (
    Background,
    ClearPixels,
    clear_pixels,
    observed_background,
)
from .cells import Cells, places_at
from .class_pixels import ClassPixels, Shown, tell_classes
from .cloud_rule import CloudRule, default_rule
from .daylight import LOWEST_SUN_DEG
from .imagery import Imagery
from .imagery_evidence import CELL_PIXELS as EVIDENCE_PIXELS
from .imagery_evidence import ClassEvidence, Seen, class_evidence, cloud_albedo
from .surface import STANDARD_K, Surface


# Cells of the grid of fractions are this many pixels wide.
CELL_PIXELS = 3
# Sine of its height from which on the sun tells albedos.
LOWEST_SUN = np.sin(np.radians(LOWEST_SUN_DEG))
# Cells of a ground that is assumed.
ASSUMED_PIXELS = 8


@dataclass(frozen=True, eq=False)
class ReducedScene:
    """A `ReducedScene` is a scene's imagery and the pixels that it was reduced from.

    **Fields:**

    - `radiance`: by band, on the grid of the imagery.
    - `good`: pixels of the Earth that all bands vouch for; `cloud`: those of them that
      are cloud.
    """

    imagery: Imagery
    radiance: dict[int, Float[np.ndarray, "y x"]]
    good: Bool[np.ndarray, "y x"]
    cloud: Bool[np.ndarray, "y x"]


def reduce_scene(
    scene: AbiScene,
    bands: Iterable[int] | None = None,
    rule: CloudRule | None = None,
    classes: Mapping[str, CloudClass] | None = None,
    *,
    weather: WeatherCube | None = None,
    fewest_cloud_pixels: int = 1,
) -> ReducedScene:
    """Reduce a scene to its imagery.

    **Arguments:**

    - `bands`: to use; all that the scene holds by default.
    - `rule`: which pixels are cloud; by default what the bands and the hour allow.
    - `classes`: to tell clouds into; by default those of `imagery_classes`. Those that
      have no rule in imagery, or no pixel in this one, are left out.
    - `weather`: of that hour, for the ground of a scene that shows none.

    **Raises:** `DataError` if reflective bands are asked of a scene in the dark, if no
    band tells cloud from surface, if a band has no good pixel, if there are too few
    cloud pixels, or if no pixel is clear and nothing else tells what is below.
    """
    scene = scene.on_common_grid(bands)
    good, day = _good(scene, scene.grid), _is_light(scene, scene.grid)
    pixels = _pixels(scene, good, rule or _rule(scene, day), fewest_cloud_pixels)
    known = {n: _band(band, day) for n, band in scene.bands.items()}
    clear = clear_pixels(scene.grid, good & ~pixels.cloud, pixels.reflectance)
    background, notes = _background(scene, good, clear, known, weather)
    shown = pixels.shown(clear)
    classes = imagery_classes() if classes is None else classes
    told = tell_classes(shown, classes)
    cells = Cells.covering(scene.grid, good, CELL_PIXELS)
    imagery = Imagery(
        name=_folder(scene),
        platform=scene.platform,
        time=scene.time,
        grid=scene.grid,
        rule=pixels.rule,
        bands=known,
        earth_sun_distance_au=earth_sun_distance_au(scene.time),
        latitude_deg=cells.latitude_deg,
        longitude_deg=cells.longitude_deg,
        fractions=_fractions(cells, scene.grid, told, classes),
        background=background,
        notes=(*scene.notes, *notes),
    )
    imagery = replace(imagery, evidence=_evidence(scene, imagery, shown, told, classes))
    images = {number: band.radiance for number, band in scene.bands.items()}
    return ReducedScene(imagery, images, good, pixels.cloud)


@dataclass(frozen=True, eq=False)
class _Pixels:
    """What the bands show of each pixel: by number, reflectances and temperatures."""

    good: Bool[np.ndarray, "y x"]
    cloud: Bool[np.ndarray, "y x"]
    reflectance: dict[int, Float[np.ndarray, "y x"]]
    kelvin: dict[int, Float[np.ndarray, "y x"]]
    rule: CloudRule

    def shown(self, clear: ClearPixels) -> Shown:
        """What tells classes apart, in the bands by which the rule tells clouds."""
        bright, cold = self.rule.bright_band, self.rule.cold_band
        return Shown(
            self.good,
            self.cloud,
            self.good & ~self.cloud & ~clear.sure,
            self.reflectance.get(bright) if bright else None,
            self.kelvin.get(cold) if cold else None,
        )


def _good(scene: AbiScene, grid: FixedGrid) -> Bool[np.ndarray, "y x"]:
    """The pixels of the Earth that are good in all bands."""
    earth = grid.sees_the_earth()
    if not earth.any():
        raise DataError(
            f"No pixel of {_folder(scene)} sees the Earth: choose another scene."
        )
    for number, band in scene.bands.items():
        if not (band.good & earth).any():
            raise DataError(
                f"Band {number} of {_folder(scene)} has no good pixel that sees the "
                "Earth: use the other bands."
            )
    good = np.logical_and.reduce([earth, *(b.good for b in scene.bands.values())])
    if not good.any():
        raise DataError(
            f"No pixel of {_folder(scene)} is good in all of the bands "
            f"{', '.join(map(str, scene.bands))}: use fewer of them."
        )
    return good


def _pixels(scene: AbiScene, good, rule: CloudRule, fewest: int) -> _Pixels:
    reflectance, kelvin = {}, {}
    for n, band in scene.bands.items():
        if isinstance(band.calibration, ReflectiveCalibration):
            reflectance[n] = band.calibration.reflectance(band.radiance)
        else:
            kelvin[n] = band.calibration.brightness_temperature_k(band.radiance)
    cloud = rule.select(reflectance, kelvin) & good
    if cloud.sum() < fewest:
        raise DataError(
            f"{_folder(scene)} holds {cloud.sum()} cloud pixels ({rule}), and a fit "
            f"needs {fewest}: choose another scene or another rule."
        )
    return _Pixels(good, cloud, reflectance, kelvin, rule)


def _folder(scene: AbiScene) -> str:
    return printable(next(iter(scene.bands.values())).path.parent.name)


def _is_light(scene: AbiScene, grid: FixedGrid) -> bool:
    """Whether the sun is up; an error if it is not but reflective bands are asked."""
    dark = [
        n
        for n, band in scene.bands.items()
        if isinstance(band.calibration, ReflectiveCalibration)
    ]
    height, hit = _sun_height(scene, grid)
    highest = float(np.degrees(np.arcsin(height[hit].max()))) if hit.any() else -90.0
    if dark and highest < LOWEST_SUN_DEG:
        raise DataError(
            f"{_folder(scene)} is dark (the sun stands at {highest:.0f} deg at most), "
            f"so that bands {dark} see no cloud: fit bands of 7 to 16 alone."
        )
    return highest >= LOWEST_SUN_DEG


def _sun_height(scene: AbiScene, grid: FixedGrid):
    """Sine of the sun's height over each pixel, and whether it sees the Earth."""
    ground, hit = grid.rays().ground()
    vertical = up(ground.latitude_deg, ground.longitude_deg)
    height = vertical @ sun_direction(scene.time)
    return height.reshape(grid.shape), hit.reshape(grid.shape)


def _rule(scene: AbiScene, day: bool) -> CloudRule:
    try:
        return default_rule(list(scene.bands), day=day)
    except ValueError as error:
        raise DataError(f"In {_folder(scene)} {error}.") from error


def _altitude_m(one: CloudClass) -> float:
    middle_m = (one.shell.bottom_m + one.shell.top_m) / 2
    told_m = None if one.imagery is None else one.imagery.altitude_m
    return middle_m if told_m is None else told_m


def _fractions(
    cells: Cells,
    grid: FixedGrid,
    told: Mapping[str, ClassPixels],
    classes: Mapping[str, CloudClass],
) -> dict[str, Float[np.ndarray, "lat lon"]]:
    return {
        name: _fraction(cells, grid, _altitude_m(classes[name]), pixels)
        for name, pixels in told.items()
    }


def _fraction(
    cells: Cells, grid: FixedGrid, altitude_m: float, pixels: ClassPixels
) -> Float[np.ndarray, "lat lon"]:
    """The share of the sky that a class covers, as seen past those above it."""
    latitude, longitude, hit = places_at(grid, altitude_m)
    use = hit & pixels.seen.reshape(-1)
    covered = pixels.own.reshape(-1)[use].astype(float)
    return np.clip(cells.mean(latitude[use], longitude[use], covered), 0, 1)


def _evidence(
    scene: AbiScene,
    imagery: Imagery,
    shown: Shown,
    told: Mapping[str, ClassPixels],
    classes: Mapping[str, CloudClass],
) -> dict[str, ClassEvidence]:
    """What the pixels of each class tell, where a window is seen."""
    cold, grid = imagery.rule.cold_band, scene.grid
    if cold is None:
        return {}
    calibration = scene.bands[cold].calibration
    assert isinstance(calibration, EmissiveCalibration)
    kelvin = calibration.brightness_temperature_k
    seen = _seen(scene, imagery, cold, kelvin)
    cells = Cells.covering(grid, shown.good, EVIDENCE_PIXELS)
    masks = LatLonGrid.from_axes(imagery.latitude_deg, imagery.longitude_deg)
    found = {}
    for name, pixels in told.items():
        shell, places = classes[name].shell, places_at(grid, _altitude_m(classes[name]))
        fraction = masks.sample(imagery.fractions[name][..., None], *places[:2])
        found[name] = class_evidence(
            cells,
            places,
            pixels.own,
            np.asarray(fraction).reshape(grid.shape),
            shell.top_m - shell.bottom_m,
            seen,
            kelvin,
        )
    return found


def _seen(scene: AbiScene, imagery: Imagery, cold: int, kelvin) -> Seen:
    grid, bright = scene.grid, imagery.rule.bright_band
    below = imagery.background.on(grid)
    window = np.asarray(scene.bands[cold].radiance, float)
    if bright is None:
        return Seen.by_night(window, below[cold], kelvin(np.maximum(window, 1e-3)))
    calibration = scene.bands[bright].calibration
    assert isinstance(calibration, ReflectiveCalibration)
    height = np.maximum(_sun_height(scene, grid)[0], LOWEST_SUN)
    albedo = cloud_albedo(
        calibration.reflectance(scene.bands[bright].radiance) / height,
        calibration.reflectance(below[bright]) / height,
    )
    return Seen.by_day(albedo, window, below[cold])


def _background(
    scene: AbiScene,
    good: Bool[np.ndarray, "y x"],
    clear: ClearPixels,
    bands: Mapping[int, Band],
    weather: WeatherCube | None,
) -> tuple[Background, tuple[str, ...]]:
    """What is seen without clouds, and sentences on what had to be assumed."""
    if clear.sure.any():
        radiance = {number: band.radiance for number, band in scene.bands.items()}
        return observed_background(scene.grid, clear, radiance), ()
    cells = Cells.covering(scene.grid, good, ASSUMED_PIXELS)
    ground = assumed_background(
        bands,
        Surface.of(weather),
        earth_sun_distance_au(scene.time),
        scene.time,
        cells.latitude_deg,
        cells.longitude_deg,
    )
    warm = (
        f"{STANDARD_K:g} K of the standard atmosphere"
        if weather is None
        else f"the temperature in {weather.path.name}"
    )
    return ground, (
        f"No pixel is clear: the ground is that of the table of land and sea, at {warm}"
        ", and not observed.",
    )


def _band(band: AbiBand, day: bool) -> Band:
    found = band_of_file(band)
    sees_the_sun = day or found.reflective
    return found if sees_the_sun else replace(found, solar_irradiance=None)
