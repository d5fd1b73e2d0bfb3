"""Images of single bands, in the quantities that they are asked for."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
import xarray as xr
from jaxtyping import Float
from matplotlib.figure import Figure

from cloudjax import Band
from cloudjax_data import DataError, EmissiveCalibration

from . import display
from .display import Display
from .quantity import ALL, BRIGHTNESS_TEMPERATURE, QUANTITIES, REFLECTANCE, Quantity


@dataclass(frozen=True, eq=False)
class BandImage:
    """Radiances of one band, and what is needed to say them otherwise.

    **Fields:**

    - `coefficients`: `kappa0` of the date, or `fk1`, `fk2`, `bc1`, `bc2`.
    - `radiance`: in `band.units`.
    """

    band: Band
    coefficients: Mapping[str, float]
    radiance: Float[np.ndarray, "*pixels"]

    @property
    def title(self) -> str:
        """Give the title, such as "C13 10.3 µm"."""
        return f"{self.band.name} {self.band.wavelength_um:.3g} µm"

    @property
    def looked_at(self) -> Quantity:
        """Give the quantity that people look at."""
        return REFLECTANCE if self.band.reflective else BRIGHTNESS_TEMPERATURE

    @property
    def display(self) -> Display:
        """Give how the band is shown."""
        if self.band.reflective:
            return display.REFLECTANCE
        return display.BRIGHTNESS_TEMPERATURE

    @property
    def shown(self) -> Float[np.ndarray, "*pixels"]:
        """Return the reflectance factor πL/E, or the brightness temperature in kelvin.

        Both as satpy has them, but for the factor instead of per cent: it is not
        divided by the cosine of the solar zenith angle.
        """
        if self.band.reflective:
            return self.radiance * self.coefficients["kappa0"]
        planck = {k: self.coefficients[k] for k in ("fk1", "fk2", "bc1", "bc2")}
        return EmissiveCalibration(**planck).brightness_temperature_k(self.radiance)

    def variables(self, quantities: Sequence[Quantity]) -> dict[str, xr.DataArray]:
        """Return the quantities that the band has of these, with CF attributes."""
        return {
            f"{quantity.variable}_{self.band.name}": self._array(quantity)
            for quantity in quantities
            if quantity in _quantities_of(self.band)
        }

    def _array(self, quantity: Quantity) -> xr.DataArray:
        shown = quantity is self.looked_at
        values = self.shown if shown else self.radiance
        per = "wavelength" if self.band.reflective else "wavenumber"
        return xr.DataArray(
            values.astype(np.float32),
            dims=("y", "x"),
            attrs={
                "standard_name": quantity.standard_name.format(per=per),
                "long_name": f"simulated {quantity.words} of ABI band "
                f"{self.band.number}",
                "units": quantity.units or self.band.units,
                "abi_band": self.band.number,
                "wavelength_um": self.band.wavelength_um,
            },
        )


def chosen_quantities(
    names: Sequence[str], bands: Iterable[Band]
) -> tuple[Quantity, ...]:
    """Return the quantities of these names that some band has; `ALL` names all.

    **Raises:** `DataError` for a quantity that none of the bands has.
    """
    bands = list(bands)
    held = {quantity for band in bands for quantity in _quantities_of(band)}
    if ALL in names:
        return tuple(q for q in QUANTITIES.values() if q in held)
    for name in names:
        if QUANTITIES[name] not in held:
            numbers = ", ".join(str(band.number) for band in bands)
            raise DataError(
                f"No band of {numbers} has a {QUANTITIES[name].words}: reflectance is "
                "of bands 1 to 6 and brightness temperature of 7 to 16."
            )
    return tuple(q for q in QUANTITIES.values() if q.name in names)


class BandPicture:
    """A `BandPicture` is a figure of one grey panel per band: white is bright, or cold.

    **Arguments:**

    - `panel_inches`: width of a panel.
    - `missing`: the colour of pixels without radiance.
    - `ranges`: of the shades of each panel; by default what the images hold.
    """

    def __init__(
        self,
        images: Sequence[BandImage],
        title: str,
        *,
        panel_inches: float,
        missing: str,
        ranges: Sequence[tuple[float, float]] | None = None,
    ):
        rows, columns = images[0].radiance.shape
        height = 0.92 * panel_inches * min(max(rows / columns, 0.3), 2.0)
        size = panel_inches * len(images), height + 0.6
        self.figure = Figure(figsize=size, layout="compressed")
        panels = self.figure.subplots(1, len(images), squeeze=False)[0]
        ranges = (
            [shade_range([image]) for image in images] if ranges is None else ranges
        )
        self._drawn = [
            self._draw(*panel, missing)
            for panel in zip(panels, images, ranges, strict=True)
        ]
        self._title = self.figure.suptitle(title, fontsize=11)

    def _draw(self, axes, image: BandImage, limits: tuple[float, float], missing: str):
        how, (low, high) = image.display, limits
        shades = matplotlib.colormaps[how.colormap].with_extremes(bad=missing)
        drawn = axes.imshow(image.shown, cmap=shades, vmin=low, vmax=high)
        axes.set_title(image.title, fontsize=10)
        axes.set_xticks([])
        axes.set_yticks([])
        self.figure.colorbar(drawn, ax=axes, label=how.label, fraction=0.046, pad=0.02)
        return drawn

    def show(self, images: Sequence[BandImage], title: str) -> None:
        """Put other images of the same bands and sizes in their places."""
        for drawn, image in zip(self._drawn, images, strict=True):
            drawn.set_data(image.shown)
        self._title.set_text(title)


def write_band_picture(
    path: str | os.PathLike[str],
    images: Sequence[BandImage],
    title: str,
    *,
    panel_inches: float,
    missing: str,
) -> None:
    """Write a `BandPicture` as PNG; arguments as of that."""
    picture = BandPicture(images, title, panel_inches=panel_inches, missing=missing)
    how = {"dpi": 130, "bbox_inches": "tight", "metadata": {"Software": None}}
    picture.figure.savefig(path, **how)


def shade_range(images: Sequence[BandImage]) -> tuple[float, float]:
    """Find the values from black to white, or back, of images of one band."""
    values = np.concatenate([image.shown.ravel() for image in images])
    known = values[np.isfinite(values)]
    if not known.size:
        return 0.0, 1.0
    low, high = (float(x) for x in np.percentile(known, [0.5, 99.5]))
    return (low, high) if images[0].display.thermal else (0.0, max(high, 0.05))


def _quantities_of(band: Band) -> tuple[Quantity, ...]:
    shown = REFLECTANCE if band.reflective else BRIGHTNESS_TEMPERATURE
    return QUANTITIES["radiance"], shown
