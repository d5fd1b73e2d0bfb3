"""What a sensor would see of a world, as a Dataset and as a picture."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
import xarray as xr
from jaxtyping import Bool, Float, Int

import cloudjax
from cloudjax import (
    Band,
    BandRadiances,
    Camera,
    CloudProducts,
    FixedGrid,
    Scene,
    render,
)
from cloudjax.geometry.path import ground_points
from cloudjax.geometry.rays import GroundPoints
from cloudjax_data import (
    GRID_MAPPING,
    earth_sun_distance_au,
    fixed_grid_coordinates,
    sun_direction,
)

from .band_image import BandImage, write_band_picture
from .model_scene import ModelWorld
from .quality import quality_attributes
from .quantity import RADIANCE, Quantity
from .sensors import Sensor
from .weather_scene import World
from .winds import Winds


# Sine of the sun's height: at 6 degrees below the horizon clouds are dark as well.
LEAST_SUN = -0.1
# Less of a pixel than this is no cloud with a height or a class.
LEAST_FRACTION = 0.05


@dataclass(frozen=True, eq=False)
class SensorImage:
    """A `SensorImage` is a rendered frame, on the pixels of the sensor.

    **Fields:**

    - `radiance`: by band, in its own units; NaN where a pixel sees neither Earth nor
      cloud.
    - `latitude_deg`, `longitude_deg`: where pixels meet the ground, else NaN.
    - `cloud_fraction`, `cloud_optical_depth`, `cloud_top_height_m`: the last NaN where
      there is no cloud.
    - `cloud_class`: number of the class that stops the most light, from 1; 0 is clear.
    """

    sensor: Sensor
    time: datetime
    radiance: dict[int, Float[np.ndarray, "y x"]]
    latitude_deg: Float[np.ndarray, "y x"]
    longitude_deg: Float[np.ndarray, "y x"]
    cloud_fraction: Float[np.ndarray, "y x"]
    cloud_optical_depth: Float[np.ndarray, "y x"]
    cloud_top_height_m: Float[np.ndarray, "y x"]
    cloud_class: Int[np.ndarray, "y x"]
    class_names: tuple[str, ...]

    @property
    def title(self) -> str:
        """Name the sensor and the time."""
        return f"{self.sensor.name} {self.time:%Y-%m-%d %H:%M} UTC, simulated"

    def bands(self) -> list[BandImage]:
        """Return the radiances of all bands."""
        return [self.band(number) for number in self.radiance]

    def band(self, number: int) -> BandImage:
        """Return the radiances of a band, with its coefficients of that date."""
        band = self.sensor.bands[number]
        distance = earth_sun_distance_au(self.time)
        return BandImage(band, band.coefficients(distance), self.radiance[number])


def render_sensor(
    world: World | ModelWorld,
    sensor: Sensor,
    bands: list[Band],
    time: datetime,
    winds: Winds | None = None,
    *,
    on_tile: Callable[[int, int], None] | None = None,
) -> SensorImage:
    """Render one frame.

    **Arguments:**

    - `winds`: how they have drawn the clouds, where that is at hand; else the world's.
    - `on_tile`: called with the numbers of rays done and of all.
    """
    view, sun = sensor.view, sun_direction(time)
    rays = view.rays()
    ground, hit = ground_points(rays)
    scene = world.scene(bands, time, winds, day=is_day(ground, hit, sun))
    pixels = rendered_pixels(view, hit)
    image = render(
        scene,
        rays if len(pixels) == hit.size else rays[pixels],
        sun,
        with_products=True,
        on_tile=on_tile,
    )
    assert image.clouds is not None
    cloudy = image.clouds.fraction > LEAST_FRACTION
    whole = _OnGrid(pixels, view.shape)
    return SensorImage(
        sensor=sensor,
        time=time,
        radiance=_radiance(scene, image.radiances, hit[pixels] | cloudy, whole),
        latitude_deg=np.where(hit, ground.latitude_deg, np.nan).reshape(view.shape),
        longitude_deg=np.where(hit, ground.longitude_deg, np.nan).reshape(view.shape),
        **_cloud_fields(image.clouds, cloudy, world.strategy.share, whole),
        class_names=tuple(world.classes),
    )


@dataclass(frozen=True, eq=False)
class _OnGrid:
    """Puts values of some pixels in their places."""

    pixels: Int[np.ndarray, " n"]
    shape: tuple[int, int]

    def __call__(self, values, missing=np.nan):
        whole = np.full(self.shape, missing, values.dtype)
        whole.reshape(-1)[self.pixels] = values
        return whole


def _radiance(scene: Scene, seen: BandRadiances, known, whole: _OnGrid):
    """By band, NaN where nothing is known."""
    rows = zip(scene.bands, np.asarray(scene.total(seen)), strict=True)
    return {number: whole(np.where(known, row, np.nan)) for number, row in rows}


def _cloud_fields(clouds: CloudProducts, cloudy, share: float, whole: _OnGrid):
    """Those fields of an image that tell of its clouds."""
    return {
        # Rounding leaves some below 0.
        "cloud_fraction": whole(np.clip(clouds.fraction, 0, 1)),
        "cloud_optical_depth": whole(clouds.optical_depth / share),
        "cloud_top_height_m": whole(np.where(cloudy, clouds.top_height_m, np.nan)),
        "cloud_class": whole(_classes(clouds, cloudy), 0),
    }


def rendered_pixels(
    view: FixedGrid | Camera, hit: Bool[np.ndarray, " n"]
) -> Int[np.ndarray, " rendered"]:
    """Choose the pixels that are rendered, by which of them see the ground.

    A fixed grid has much of space, a camera the limb and the sky with their clouds.
    """
    spared = isinstance(view, FixedGrid) and hit.any()
    return np.flatnonzero(hit) if spared else np.arange(hit.size)


def is_day(ground: GroundPoints, hit, sun: Float[np.ndarray, "3"]) -> bool:
    """Tell whether the sun can reach clouds anywhere in view, so that band 7 reflects.

    Bands that reflect only are rendered at night too, and are dark then. Where all
    rays miss the Earth nothing is known of the hour.
    """
    return not hit.any() or bool((ground.upward @ sun)[hit].max() > LEAST_SUN)


def sensor_dataset(
    image: SensorImage,
    world: World | ModelWorld,
    quantities: Sequence[Quantity] = (RADIANCE,),
) -> xr.Dataset:
    """Make a CF-1.8 Dataset with radiances, or other quantities, and cloud products.

    On `(y, x)` of the geostationary projection for a fixed grid, with latitudes and
    longitudes on `(y, x)` for a camera, whose `x` and `y` count pixels.
    """
    view = image.sensor.view
    variables = {
        name: array
        for number in image.radiance
        for name, array in image.band(number).variables(quantities).items()
    } | _products(image)
    if isinstance(view, FixedGrid):
        for variable in variables.values():
            variable.encoding["grid_mapping"] = GRID_MAPPING
    return xr.Dataset(
        variables,
        coords=_coordinates(image),
        attrs={
            "Conventions": "CF-1.8",
            "title": "Simulated radiances and clouds",
            "source": f"cloudjax {cloudjax.__version__}",
            "sensor": image.sensor.name,
            "platform": image.sensor.platform,
            "weather": ", ".join(world.sources),
            "seed": world.seed,
        }
        | quality_attributes(world, world.strategy),
    )


def _coordinates(image: SensorImage) -> dict[str, xr.DataArray]:
    view = image.sensor.view
    if isinstance(view, FixedGrid):
        coordinates = fixed_grid_coordinates(view)
    else:
        coordinates = {
            axis: xr.DataArray(np.arange(n), dims=axis, attrs={"units": "1"})
            for axis, n in zip(("y", "x"), view.shape, strict=True)
        } | {
            "latitude": _plain(image.latitude_deg, "latitude", "degrees_north"),
            "longitude": _plain(image.longitude_deg, "longitude", "degrees_east"),
        }
    coordinates["time"] = xr.DataArray(
        np.datetime64(image.time.replace(tzinfo=None), "ns"),
        attrs={"standard_name": "time"},
    )
    return coordinates


def write_picture(
    path: str | os.PathLike[str], bands: Sequence[BandImage], title: str
) -> None:
    """Write grey panels of bands as PNG: white is bright, or cold."""
    write_band_picture(path, bands, title, panel_inches=7.0, missing="#10141a")


def _classes(clouds: CloudProducts, cloudy) -> Int[np.ndarray, " rays"]:
    first = np.argmax(np.asarray(clouds.share), axis=0) + 1
    return np.where(cloudy, first, 0).astype(np.int8)


def _products(image: SensorImage) -> dict[str, xr.DataArray]:
    classes = xr.DataArray(
        image.cloud_class,
        dims=("y", "x"),
        attrs={
            "long_name": "class of the cloud that stops the most of what is seen",
            "flag_values": np.arange(len(image.class_names) + 1, dtype=np.int8),
            "flag_meanings": " ".join(
                name.replace(" ", "_") for name in ("clear", *image.class_names)
            ),
        },
    )
    return {
        "cloud_fraction": _plain(image.cloud_fraction, "cloud_area_fraction", "1"),
        "cloud_optical_depth": _plain(
            image.cloud_optical_depth,
            "atmosphere_optical_thickness_due_to_cloud",
            "1",
        ),
        "cloud_top_height": _plain(image.cloud_top_height_m, "cloud_top_altitude", "m"),
        "cloud_class": classes,
    }


def _plain(values, standard_name: str, units: str) -> xr.DataArray:
    return xr.DataArray(
        np.asarray(values, np.float32),
        dims=("y", "x"),
        attrs={"standard_name": standard_name, "units": units},
    )
