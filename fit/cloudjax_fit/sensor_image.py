"""What a sensor would see of a world, and its file and picture."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import jax.numpy as jnp
import matplotlib
import numpy as np
import xarray as xr
from jaxtyping import Float, Int
from matplotlib.figure import Figure

from cloudjax import (
    BandRadiances,
    CloudProducts,
    FixedGrid,
    Scene,
    Weather,
    render,
)
from cloudjax_data import (
    GRID_MAPPING,
    earth_sun_distance_au,
    fixed_grid_coordinates,
    sun_direction,
)

from .figures import BRIGHTNESS_TEMPERATURE, REFLECTANCE, Display
from .fitting import versions
from .image_file import data_grid, radiance_array
from .model import LIGHTS
from .netcdf import write_netcdf
from .sensor_band import SensorBand
from .sensor_file import Sensor
from .staging import staged
from .world import World


# Less of a pixel than this is no cloud with a height or a class.
LEAST_FRACTION = 0.05


@dataclass(frozen=True, eq=False)
class SensorImage:
    """A rendered frame, on the pixels of the sensor.

    **Fields:**

    - `radiance`: by band, in its own units; NaN where a pixel sees neither Earth nor
      cloud.
    - `shown`: the same as reflectance factor or brightness temperature in kelvin.
    - `latitude_deg`, `longitude_deg`: where pixels meet the ground, else NaN.
    - `cloud_fraction`, `cloud_optical_depth`, `cloud_top_height_m`: the last NaN where
      there is no cloud.
    - `cloud_class`: number of the class that stops the most light, from 1; 0 is clear.
    """

    sensor: Sensor
    time: datetime
    radiance: dict[int, Float[np.ndarray, "y x"]]
    shown: dict[int, Float[np.ndarray, "y x"]]
    latitude_deg: Float[np.ndarray, "y x"]
    longitude_deg: Float[np.ndarray, "y x"]
    cloud_fraction: Float[np.ndarray, "y x"]
    cloud_optical_depth: Float[np.ndarray, "y x"]
    cloud_top_height_m: Float[np.ndarray, "y x"]
    cloud_class: Int[np.ndarray, "y x"]
    class_names: tuple[str, ...]


def render_sensor(
    world: World,
    sensor: Sensor,
    bands: list[SensorBand],
    time: datetime,
    weather: Weather | None = None,
    *,
    resolution: int = 128,
    on_tile: Callable[[int, int], None] | None = None,
) -> SensorImage:
    """Render one frame.

    **Arguments:**

    - `weather`: of that time, where it is at hand; else the world's.
    - `resolution`: voxels per axis of the textures.
    - `on_tile`: called with the numbers of rays done and of all.

    **Raises:** `DataError` if the resolution is too coarse for a texture.
    """
    world.require_resolution(resolution)
    scene = world.scene(bands, earth_sun_distance_au(time))
    view = sensor.view
    ground, hit = view.rays().ground()
    # A fixed grid has much of space, a camera the limb and the sky with their clouds.
    pixels = np.flatnonzero(hit if isinstance(view, FixedGrid) else np.ones_like(hit))
    image = render(
        scene,
        lambda index: view.rays(pixels[index]),
        sun_direction(time),
        lambda index: world.background(scene, view.rays(pixels[index]), time),
        world.weather(time) if weather is None else weather,
        rays=len(pixels),
        resolution=resolution,
        with_products=True,
        on_tile=on_tile,
    )
    clouds = image.clouds
    assert clouds is not None
    cloudy = clouds.fraction > LEAST_FRACTION
    something = hit[pixels] | cloudy

    def on_grid(values, missing=np.nan):
        whole = np.full(hit.size, missing, values.dtype)
        whole[pixels] = values
        return whole.reshape(view.shape)

    radiance, shown = {}, {}
    for number, values, looks in _by_band(scene, image.radiances):
        radiance[number] = on_grid(np.where(something, values, np.nan))
        shown[number] = on_grid(np.where(something, looks, np.nan))
    return SensorImage(
        sensor=sensor,
        time=time,
        radiance=radiance,
        shown=shown,
        latitude_deg=np.where(hit, ground.latitude_deg, np.nan).reshape(view.shape),
        longitude_deg=np.where(hit, ground.longitude_deg, np.nan).reshape(view.shape),
        # Rounding leaves some below 0.
        cloud_fraction=on_grid(np.clip(clouds.fraction, 0, 1)),
        cloud_optical_depth=on_grid(clouds.optical_depth / LIGHTS[world.light].share),
        cloud_top_height_m=on_grid(np.where(cloudy, clouds.top_height_m, np.nan)),
        cloud_class=on_grid(_classes(clouds, cloudy), 0),
        class_names=tuple(world.classes),
    )


def write_sensor_image(
    path: str | os.PathLike[str], image: SensorImage, world: World
) -> None:
    """Write a CF netCDF file, and a PNG of the same name beside it.

    **Raises:** `DataError` if the disk does not take them.
    """
    path = Path(path)
    with staged(path.parent, last=path.name) as aside:
        write_picture(aside / path.with_suffix(".png").name, image)
        write_netcdf(aside / path.name, sensor_dataset(image, world))


def sensor_dataset(image: SensorImage, world: World) -> xr.Dataset:
    """A CF-1.8 Dataset with radiances and cloud products.

    On `(y, x)` of the geostationary projection for a fixed grid, with latitudes and
    longitudes on `(y, x)` for a camera, whose `x` and `y` count pixels.
    """
    view = image.sensor.view
    if isinstance(view, FixedGrid):
        coordinates = fixed_grid_coordinates(data_grid(view))
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
    variables = {
        f"radiance_C{number:02d}": radiance_array(values, image.sensor.bands[number])
        for number, values in image.radiance.items()
    } | _products(image)
    if isinstance(view, FixedGrid):
        for variable in variables.values():
            variable.encoding["grid_mapping"] = GRID_MAPPING
    return xr.Dataset(
        variables,
        coords=coordinates,
        attrs={
            "Conventions": "CF-1.8",
            "title": "Simulated radiances and clouds",
            "source": f"cloudjax {versions()['cloudjax']}",
            "sensor": image.sensor.name,
            "platform": image.sensor.platform,
            "weather": ", ".join(cube.path.name for cube in world.series.cubes),
            "seed": world.seed,
            "steps": world.steps,
            "light": world.light,
        },
    )


def write_picture(path: str | os.PathLike[str], image: SensorImage) -> None:
    """Grey panels of all bands as PNG: white is bright, or cold."""
    rows, columns = image.sensor.view.shape
    height = 6.5 * min(max(rows / columns, 0.3), 2.0)
    count = len(image.shown)
    figure = Figure(figsize=(7 * count, height + 0.6), layout="compressed")
    panels = figure.subplots(1, count, squeeze=False)[0]
    for axes, (number, values) in zip(panels, image.shown.items(), strict=True):
        band = image.sensor.bands[number]
        display: Display = REFLECTANCE if band.reflective else BRIGHTNESS_TEMPERATURE
        shades = matplotlib.colormaps[display.colormap].with_extremes(bad="#10141a")
        low, high = _shade_range(values, band)
        drawn = axes.imshow(values, cmap=shades, vmin=low, vmax=high)
        axes.set_title(f"{band.name} {band.wavelength_um:.3g} µm", fontsize=10)
        axes.set_xticks([])
        axes.set_yticks([])
        figure.colorbar(drawn, ax=axes, label=display.label, fraction=0.046, pad=0.02)
    figure.suptitle(
        f"{image.sensor.name} {image.time:%Y-%m-%d %H:%M} UTC, simulated", fontsize=11
    )
    figure.savefig(path, dpi=130, bbox_inches="tight", metadata={"Software": None})


def _shade_range(values, band: SensorBand) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    if not known.size:
        return 0.0, 1.0
    low, high = np.percentile(known, [0.5, 99.5])
    return (0.0, max(high, 0.05)) if band.reflective else (low, high)


def _by_band(scene: Scene, seen: BandRadiances):
    """Number, radiance and what people look at, of each band."""
    if scene.reflective is not None and seen.reflective is not None:
        bands, radiance = scene.reflective, jnp.asarray(seen.reflective)
        yield from zip(
            bands.numbers,
            np.asarray(radiance),
            np.asarray(bands.reflectance(radiance)),
            strict=True,
        )
    if scene.emissive is not None and seen.emissive is not None:
        bands, radiance = scene.emissive, jnp.asarray(seen.emissive)
        yield from zip(
            bands.numbers,
            np.asarray(radiance),
            np.asarray(bands.brightness_temperature_k(radiance)),
            strict=True,
        )


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
