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
        """Such as "C13 10.3 µm"."""
        return f"{self.band.name} {self.band.wavelength_um:.3g} µm"

    @property
    def looked_at(self) -> Quantity:
        """The quantity that people look at."""
        return REFLECTANCE if self.band.reflective else BRIGHTNESS_TEMPERATURE

    @property
    def display(self) -> Display:
        if self.band.reflective:
            return display.REFLECTANCE
        return display.BRIGHTNESS_TEMPERATURE

    @property
    def shown(self) -> Float[np.ndarray, "*pixels"]:
        """Reflectance factor πL/E, or brightness temperature in kelvin.

        Both as satpy has them, but for the factor instead of per cent: it is not
        divided by the cosine of the solar zenith angle.
        """
        if self.band.reflective:
            return self.radiance * self.coefficients["kappa0"]
        planck = {k: self.coefficients[k] for k in ("fk1", "fk2", "bc1", "bc2")}
        return EmissiveCalibration(**planck).brightness_temperature_k(self.radiance)

    def variables(self, quantities: Sequence[Quantity]) -> dict[str, xr.DataArray]:
        """Those of the quantities that the band has, with their CF attributes."""
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
    """The quantities of these names that some band has; `ALL` names all.

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


def write_band_picture(
    path: str | os.PathLike[str],
    images: Sequence[BandImage],
    title: str,
    *,
    panel_inches: float,
    missing: str,
) -> None:
    """Write one grey panel per band as PNG: white is bright, or cold.

    **Arguments:** `missing`: the colour of pixels without radiance.
    """
    rows, columns = images[0].radiance.shape
    height = 0.92 * panel_inches * min(max(rows / columns, 0.3), 2.0)
    size = panel_inches * len(images), height + 0.6
    figure = Figure(figsize=size, layout="compressed")
    panels = figure.subplots(1, len(images), squeeze=False)[0]
    for axes, image in zip(panels, images, strict=True):
        how, values = image.display, image.shown
        shades = matplotlib.colormaps[how.colormap].with_extremes(bad=missing)
        low, high = _shade_range(values, how)
        drawn = axes.imshow(values, cmap=shades, vmin=low, vmax=high)
        axes.set_title(image.title, fontsize=10)
        axes.set_xticks([])
        axes.set_yticks([])
        figure.colorbar(drawn, ax=axes, label=how.label, fraction=0.046, pad=0.02)
    figure.suptitle(title, fontsize=11)
    figure.savefig(path, dpi=130, bbox_inches="tight", metadata={"Software": None})


def _quantities_of(band: Band) -> tuple[Quantity, ...]:
    shown = REFLECTANCE if band.reflective else BRIGHTNESS_TEMPERATURE
    return QUANTITIES["radiance"], shown


def _shade_range(values, how: Display) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    if not known.size:
        return 0.0, 1.0
    low, high = np.percentile(known, [0.5, 99.5])
    return (low, high) if how.thermal else (0.0, max(high, 0.05))
