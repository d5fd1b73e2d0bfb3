"""From the radiances of a scene to the target of a fit."""

from collections.abc import Iterable

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter

from cloudjax import FixedGrid, cloud_classes
from cloudjax.air.atmosphere import temperature_k
from cloudjax.geometry.geodesy import geodetic, intersect, up
from cloudjax_data import (
    AbiBand,
    AbiScene,
    DataError,
    ReflectiveCalibration,
    earth_sun_distance_au,
    sun_direction,
)
from cloudjax_scenes.cloud_rule import CloudRule, default_rule
from cloudjax_scenes.sensor_band import nominal_bands

from .histogram import quantiles
from .targets import BINS, BandTarget, Target, block_of_pixels


# Cells of the grid of fractions are this many pixels wide, and no narrower than this.
CELL_PIXELS = 8
CELL_DEG = 0.2
BLOCKS = (8, 8)
# Below this height of the sun the reflective bands tell nothing of cloud.
LOWEST_SUN_DEG = 5.0
FEWEST_CLOUD_PIXELS = 500


def observe(
    scene: AbiScene, bands: Iterable[int] | None = None, rule: CloudRule | None = None
) -> Target:
    """Reduce a scene to a target.

    **Arguments:**

    - `bands`: to fit; all that the scene holds by default.
    - `rule`: which pixels are cloud; by default what the bands and the hour allow.

    **Raises:** `DataError` if reflective bands are asked of a scene in the dark, if no
    band tells cloud from surface, or if there are too few cloud pixels to fit.
    """
    scene = scene.on_common_grid(bands)
    images = {number: band.radiance for number, band in scene.bands.items()}
    grid = scene.grid
    good = np.logical_and.reduce([band.good for band in scene.bands.values()])
    day = _is_light(scene, grid)
    if rule is None:
        rule = _rule(scene, day)
    temperature = {
        n: band.calibration.brightness_temperature_k(images[n])
        for n, band in scene.bands.items()
        if not isinstance(band.calibration, ReflectiveCalibration)
    }
    reflectance = {
        n: band.calibration.reflectance(images[n])
        for n, band in scene.bands.items()
        if isinstance(band.calibration, ReflectiveCalibration)
    }
    cloud = rule.select(reflectance, temperature) & good
    if cloud.sum() < FEWEST_CLOUD_PIXELS:
        raise DataError(
            f"{_folder(scene)} holds {cloud.sum()} cloud pixels ({rule}), and a fit "
            f"needs {FEWEST_CLOUD_PIXELS}: choose another scene or another rule."
        )
    cells = _Cells.covering(grid, good)
    cold = temperature.get(rule.cold_band) if rule.cold_band else None
    fractions = _class_fractions(cells, grid, good, cloud, cold)
    block = block_of_pixels(grid.shape, BLOCKS)
    count = BLOCKS[0] * BLOCKS[1]
    return Target(
        name=_folder(scene),
        platform=scene.platform,
        time=scene.time,
        grid=grid,
        rule=rule,
        bands={
            n: _band_target(
                band, cloud, good & ~cloud, block, count, cells, grid, day=day
            )
            for n, band in scene.bands.items()
        },
        latitude_deg=cells.latitude_deg,
        longitude_deg=cells.longitude_deg,
        fractions=fractions,
        blocks=BLOCKS,
        block_cloud=np.bincount(block[cloud.reshape(-1)], minlength=count),
        block_valid=np.bincount(block[good.reshape(-1)], minlength=count),
    )


def _folder(scene: AbiScene) -> str:
    return next(iter(scene.bands.values())).path.parent.name


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


def _relative(longitude_deg, grid: FixedGrid):
    return (longitude_deg - grid.subsatellite_longitude_deg + 180) % 360 - 180


def _mean_of_cells(total, count, *, fill: bool) -> Float[np.ndarray, "lat lon"]:
    """Smooth averages; cells without pixels take from wider and wider surroundings."""
    result = np.full(total.shape, np.nan)
    for width in (1, 2, 4, 8, 16, 32, 64) if fill else (1,):
        pixels = gaussian_filter(count.astype(float), width, mode="constant")
        enough = pixels > 0.05
        mean = gaussian_filter(total, width, mode="constant") / np.where(
            enough, pixels, 1
        )
        result = np.where(np.isnan(result) & enough, mean, result)
    return np.where(np.isnan(result), total.sum() / max(count.sum(), 1), result)


def _class_fractions(cells, grid, good, cloud, cold_k) -> dict[str, np.ndarray]:
    """The share of the sky that each class covers, as seen past those above it.

    With a window band, cloud colder than the standard atmosphere at the top of the low
    shell cannot stand in it and counts as cirrus; without one, all cloud is low.
    """
    classes = cloud_classes()
    low, high = (classes[name].conditions for name in ("low_stratus", "cirrus"))
    if cold_k is None:
        return {"low_stratus": _fraction(cells, grid, low, good, cloud)}
    cold = cloud & (cold_k < float(temperature_k(low.shell_top_m)))
    return {
        "cirrus": _fraction(cells, grid, high, good, cold),
        "low_stratus": _fraction(cells, grid, low, good & ~cold, cloud & ~cold),
    }


def _fraction(cells, grid, shell, good, cloud) -> Float[np.ndarray, "lat lon"]:
    # At the middle of the shell, so that the line of sight's parallax is undone.
    middle_m = (shell.shell_bottom_m + shell.shell_top_m) / 2
    rays = grid.rays()
    near, _, hit = intersect(
        rays.origin_m, rays.direction, grid.ellipsoid.raised(middle_m)
    )
    latitude, longitude, _ = geodetic(rays.at(near), grid.ellipsoid)
    use = hit & good.reshape(-1)
    place = latitude[use], longitude[use]
    count = cells.total(*place, np.ones(use.sum()))
    total = cells.total(*place, cloud.reshape(-1)[use].astype(float))
    return np.clip(_mean_of_cells(total, count, fill=True), 0, 1)


def _band_target(
    band, cloud, clear, block, count, cells, grid, *, day: bool
) -> BandTarget:
    radiance = np.asarray(band.radiance, np.float64)
    table = quantiles(radiance[cloud])
    span = table.values[-1] - table.values[0]
    low, high = table.values[0] - 0.1 * span, table.values[-1] + 0.1 * span
    edges = np.linspace(low, high, BINS + 1)
    chosen = cloud.reshape(-1)
    counts, _, _ = np.histogram2d(
        block[chosen],
        radiance.reshape(-1)[chosen],
        bins=[np.arange(count + 1) - 0.5, edges],
    )
    ground, hit = grid.rays().ground()
    use = hit & clear.reshape(-1)
    place = ground.latitude_deg[use], ground.longitude_deg[use]
    background = _mean_of_cells(
        cells.total(*place, radiance.reshape(-1)[use]),
        cells.total(*place, np.ones(use.sum())),
        fill=True,
    )
    return BandTarget(
        number=band.number,
        wavelength_um=band.wavelength_um,
        units=band.units,
        coefficients=_coefficients(band, day),
        quantiles=table,
        low=float(low),
        high=float(high),
        block_counts=counts.astype(np.int64),
        background=background,
    )


def _coefficients(band: AbiBand, day: bool) -> dict[str, float]:
    c = band.calibration
    if isinstance(c, ReflectiveCalibration):
        # The files round kappa0 to five digits.
        d, irradiance = c.earth_sun_distance_au, c.solar_irradiance_w_m2_um
        return {"kappa0": np.pi * d**2 / irradiance}
    planck = {name: getattr(c, name) for name in ("fk1", "fk2", "bc1", "bc2")}
    # Files of band 7 have no solar irradiance.
    nominal = nominal_bands()[band.number]
    if not (day and nominal.sunlit):
        return planck
    known = nominal.coefficients(earth_sun_distance_au(band.time))
    return planck | {"kappa0": known["kappa0"]}
