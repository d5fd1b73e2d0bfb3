"""From the radiances of a scene to its clouds by class, and the ground below them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter

from cloudjax import Band, CloudClass, FixedGrid, imagery_classes, nominal_bands
from cloudjax.air.atmosphere import temperature_k
from cloudjax.geometry.geodesy import geodetic, intersect, up
from cloudjax_data import (
    AbiBand,
    AbiScene,
    DataError,
    ReflectiveCalibration,
    WeatherCube,
    earth_sun_distance_au,
    sun_direction,
)
from cloudjax_data.plain_path import printable

from .assumed_ground import assumed_backgrounds
from .cloud_rule import CloudRule, default_rule
from .daylight import LOWEST_SUN_DEG
from .imagery import Imagery
from .surface import STANDARD_K, Surface


# Cells of the grid of fractions are this many pixels wide, and no narrower than this.
CELL_PIXELS = 8
CELL_DEG = 0.2


@dataclass(frozen=True, eq=False)
class ReducedScene:
    """A scene's imagery and the pixels that it was reduced from.

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
    images = {number: band.radiance for number, band in scene.bands.items()}
    grid = scene.grid
    good = _good(scene, grid)
    day = _is_light(scene, grid)
    rule = _rule(scene, day) if rule is None else rule
    reflectance, kelvin = _shown(scene)
    cloud = rule.select(reflectance, kelvin) & good
    if cloud.sum() < fewest_cloud_pixels:
        raise DataError(
            f"{_folder(scene)} holds {cloud.sum()} cloud pixels ({rule}), and a fit "
            f"needs {fewest_cloud_pixels}: choose another scene or another rule."
        )
    cells = _Cells.covering(grid, good)
    window = kelvin.get(rule.cold_band) if rule.cold_band else None
    classes = imagery_classes() if classes is None else classes
    known = {n: _band(band, day) for n, band in scene.bands.items()}
    backgrounds, notes = _backgrounds(scene, cells, good & ~cloud, known, weather)
    imagery = Imagery(
        name=_folder(scene),
        platform=scene.platform,
        time=scene.time,
        grid=grid,
        rule=rule,
        bands=known,
        earth_sun_distance_au=earth_sun_distance_au(scene.time),
        latitude_deg=cells.latitude_deg,
        longitude_deg=cells.longitude_deg,
        fractions=_class_fractions(cells, grid, good, cloud, window, classes),
        backgrounds=backgrounds,
        notes=(*scene.notes, *notes),
    )
    return ReducedScene(imagery, images, good, cloud)


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


def _shown(scene: AbiScene):
    """Reflectances and brightness temperatures, by band."""
    reflectance, kelvin = {}, {}
    for n, band in scene.bands.items():
        if isinstance(band.calibration, ReflectiveCalibration):
            reflectance[n] = band.calibration.reflectance(band.radiance)
        else:
            kelvin[n] = band.calibration.brightness_temperature_k(band.radiance)
    return reflectance, kelvin


def _folder(scene: AbiScene) -> str:
    return printable(next(iter(scene.bands.values())).path.parent.name)


def _is_light(scene: AbiScene, grid: FixedGrid) -> bool:
    """Whether the sun is up; an error if it is not but reflective bands are asked."""
    dark = [
        n
        for n, band in scene.bands.items()
        if isinstance(band.calibration, ReflectiveCalibration)
    ]
    ground, hit = grid.rays().ground()
    vertical = up(ground.latitude_deg, ground.longitude_deg)
    height = np.degrees(np.arcsin(vertical @ sun_direction(scene.time)))
    highest = float(height[hit].max()) if hit.any() else -90.0
    if dark and highest < LOWEST_SUN_DEG:
        raise DataError(
            f"{_folder(scene)} is dark (the sun stands at {highest:.0f} deg at most), "
            f"so that bands {dark} see no cloud: fit bands of 7 to 16 alone."
        )
    return highest >= LOWEST_SUN_DEG


def _rule(scene: AbiScene, day: bool) -> CloudRule:
    try:
        return default_rule(list(scene.bands), day=day)
    except ValueError as error:
        raise DataError(f"In {_folder(scene)} {error}.") from error


class _Cells:
    """A regular grid of latitude and longitude, and averages of pixels over it."""

    def __init__(self, latitude_deg, longitude_deg, step_deg):
        self.latitude_deg = latitude_deg
        self.longitude_deg = longitude_deg
        self.step_deg = step_deg

    @staticmethod
    def covering(grid: FixedGrid, good: Bool[np.ndarray, "y x"]) -> "_Cells":
        ground, hit = grid.rays().ground()
        seen = hit & good.reshape(-1)
        footprint = np.nanmedian(grid.rays().footprint_m()[seen])
        step = max(CELL_DEG, CELL_PIXELS * footprint / 111e3)
        latitude = ground.latitude_deg[seen]
        # Relative to the satellite, so that no image is cut at the date line.
        east = _relative(ground.longitude_deg[seen], grid)
        rows = np.arange(latitude.min() - step, latitude.max() + 2 * step, step)
        columns = np.arange(east.min() - step, east.max() + 2 * step, step)
        return _Cells(rows, columns + grid.subsatellite_longitude_deg, step)

    def total(self, latitude_deg, longitude_deg, weights) -> Float[np.ndarray, "a b"]:
        """The sum of weights over the pixels of each cell."""
        middle = self.longitude_deg.mean()
        east = (longitude_deg - middle + 180) % 360 - 180 + middle
        edges = [
            np.append(axis, axis[-1] + self.step_deg) - self.step_deg / 2
            for axis in (self.latitude_deg, self.longitude_deg)
        ]
        return np.histogram2d(latitude_deg, east, bins=edges, weights=weights)[0]

    def mean(self, latitude_deg, longitude_deg, values) -> Float[np.ndarray, "a b"]:
        """Smooth averages; cells without pixels take from wider surroundings."""
        total = self.total(latitude_deg, longitude_deg, values)
        count = self.total(latitude_deg, longitude_deg, np.ones(len(values)))
        result = np.full(total.shape, np.nan)
        for width in (1, 2, 4, 8, 16, 32, 64):
            pixels = gaussian_filter(count.astype(float), width, mode="constant")
            enough = pixels > 0.05
            mean = gaussian_filter(total, width, mode="constant") / np.where(
                enough, pixels, 1
            )
            result = np.where(np.isnan(result) & enough, mean, result)
        return np.where(np.isnan(result), total.sum() / max(count.sum(), 1), result)


def _relative(longitude_deg, grid: FixedGrid):
    return (longitude_deg - grid.subsatellite_longitude_deg + 180) % 360 - 180


def _class_fractions(
    cells: _Cells, grid, good, cloud, window_k, classes: Mapping[str, CloudClass]
) -> dict[str, Float[np.ndarray, "lat lon"]]:
    """The share of the sky that each class covers, as seen past those above it.

    **Arguments:** `window_k`: brightness temperature; None where no window is seen.
    """
    found = {}
    for name, one in classes.items():
        rule = one.imagery
        if rule is None:
            continue
        own, seen = cloud, good
        if rule.colder_than_standard_at_m is not None:
            if window_k is None:
                continue
            own = own & (window_k < _standard_k(rule.colder_than_standard_at_m))
        if rule.warmer_than_standard_at_m is not None and window_k is not None:
            above = cloud & (window_k < _standard_k(rule.warmer_than_standard_at_m))
            own, seen = own & ~above, seen & ~above
        if own.any():
            middle_m = (one.shell.bottom_m + one.shell.top_m) / 2
            altitude_m = middle_m if rule.altitude_m is None else rule.altitude_m
            found[name] = _fraction(cells, grid, altitude_m, seen, own)
    if not found:
        raise DataError(
            f"None of the classes {', '.join(classes)} takes a cloud pixel of the "
            "scene: give one of them a table imagery whose conditions the clouds meet."
        )
    return found


def _standard_k(altitude_m: float) -> float:
    return float(temperature_k(altitude_m))


def _fraction(cells, grid, altitude_m, good, cloud) -> Float[np.ndarray, "lat lon"]:
    # Where the clouds stand, so that the line of sight's parallax is undone.
    rays = grid.rays()
    near, _, hit = intersect(
        rays.origin_m, rays.direction, grid.ellipsoid.raised(altitude_m)
    )
    latitude, longitude, _ = geodetic(rays.at(near), grid.ellipsoid)
    use = hit & good.reshape(-1)
    covered = cloud.reshape(-1)[use].astype(float)
    return np.clip(cells.mean(latitude[use], longitude[use], covered), 0, 1)


def _backgrounds(
    scene: AbiScene, cells: _Cells, clear, bands: Mapping[int, Band], weather
) -> tuple[dict[int, Float[np.ndarray, "lat lon"]], tuple[str, ...]]:
    """What is seen without clouds, by band, and sentences on what had to be assumed."""
    if clear.any():
        found = {
            n: _background(cells, scene.grid, clear, band.radiance)
            for n, band in scene.bands.items()
        }
        return found, ()
    ground = assumed_backgrounds(
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


def _background(cells, grid, clear, radiance) -> Float[np.ndarray, "lat lon"]:
    """What the clear pixels show, on the grid of the cells."""
    values = np.asarray(radiance, np.float64).reshape(-1)
    ground, hit = grid.rays().ground()
    use = hit & clear.reshape(-1)
    return cells.mean(ground.latitude_deg[use], ground.longitude_deg[use], values[use])


def _band(band: AbiBand, day: bool) -> Band:
    c, distance_au = band.calibration, earth_sun_distance_au(band.time)
    if isinstance(c, ReflectiveCalibration):
        # The files round kappa0 to five digits, and have a distance of their own.
        irradiance = c.solar_irradiance_w_m2_um
        solar = irradiance * (distance_au / c.earth_sun_distance_au) ** 2
        return Band(band.number, band.wavelength_um, solar)
    # Files of band 7 have no solar irradiance.
    nominal = nominal_bands()[band.number]
    return Band(
        band.number,
        band.wavelength_um,
        nominal.solar_irradiance if day else None,
        (c.fk1, c.fk2, c.bc1, c.bc2),
    )
