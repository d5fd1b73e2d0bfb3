"""What an image was seen from, for a model to be seen from the same."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np
from jaxtyping import Bool

from cloudjax import Band, FixedGrid
from cloudjax.geometry.fixed_grid import RAD_PER_KM
from cloudjax_data import DataError
from cloudjax_scenes.daylight import (
    LOWEST_SUN_DEG,
    shows_sunlit_clouds,
    sun_heights_deg,
)

from .band_radiances import BandRadiances


@dataclass(frozen=True, eq=False)
class Vantage:
    """A `Vantage` is a sensor at a time, as an image of several bands tells it.

    **Fields:**

    - `name`: of the image.
    - `radiances`: by band, each on its own grid.
    - `bands`: what radiances mean in them.
    - `grid`: on which all of them are compared: that of the coarsest, or a coarser one.
    - `time`: in UTC.
    - `notes`: sentences on bands that were left out.
    """

    name: str
    radiances: Mapping[int, BandRadiances]
    bands: Mapping[int, Band]
    grid: FixedGrid
    time: datetime
    notes: tuple[str, ...] = ()

    @property
    def resolution_km(self) -> float:
        """Give the width of a pixel of the grid, below the satellite."""
        return self.grid.step_rad / RAD_PER_KM

    def cropped(
        self, box: FixedGrid, over: Bool[np.ndarray, "y x"]
    ) -> dict[int, BandRadiances]:
        """Return the radiances in a box of the grid, NaN where they do not count.

        **Arguments:** `over`: pixels of the box that count.

        **Raises:** `DataError` where finer pixels do not fill those of the box.
        """
        return {n: self._cropped(b, box, over) for n, b in self.radiances.items()}

    def _cropped(self, band: BandRadiances, box: FixedGrid, over) -> BandRadiances:
        assert band.grid is not None
        rows, columns = (
            _within(own, wanted, box.step_rad)
            for own, wanted in (
                (band.grid.y_rad, box.y_rad),
                (band.grid.x_rad, box.x_rad),
            )
        )
        grid = replace(
            band.grid, y_rad=band.grid.y_rad[rows], x_rad=band.grid.x_rad[columns]
        )
        factor = round(box.step_rad / band.grid.step_rad)
        if grid.shape != tuple(factor * size for size in box.shape):
            raise DataError(
                f"The pixels of band {band.number} of {self.name} do not nest in those "
                f"of {self.resolution_km:g} km: choose bands of one resolution with "
                "--bands."
            )
        counts = np.repeat(np.repeat(over, factor, axis=0), factor, axis=1)
        image = np.asarray(band.values)[np.ix_(rows, columns)]
        return replace(band, values=np.where(counts, image, np.nan), grid=grid)


def vantage_of(
    radiances: Mapping[int, BandRadiances],
    name: str,
    resolution_km: float | None = None,
) -> Vantage:
    """Find what an image was seen from.

    Bands that only reflect are left out in the dark.

    **Arguments:** `resolution_km`: of the grid; by default that of the coarsest band.

    **Raises:** `DataError` if it is not known where or when the image was seen, or what
    its radiances mean; if its bands have nothing in common, are all dark, or do not
    fill pixels of that size.
    """
    _require_known(radiances, name)
    some = max(radiances.values(), key=lambda b: b.grid.step_rad if b.grid else 0)
    assert some.grid is not None
    assert some.time is not None
    lit, notes = _lit(radiances, some.grid, some.time, name)
    coarsest = max((b.grid for b in lit.values() if b.grid), key=lambda g: g.step_rad)
    return Vantage(
        name=name,
        radiances=lit,
        bands={n: b.band for n, b in lit.items() if b.band is not None},
        grid=_of_resolution(coarsest, resolution_km, name),
        time=some.time,
        notes=notes,
    )


def _require_known(radiances: Mapping[int, BandRadiances], name: str) -> None:
    for number, band in radiances.items():
        if band.grid is None or band.time is None:
            what = "no fixed grid" if band.grid is None else "no time"
            raise DataError(
                f"{name} gives {what} for band {number}, and a model is rendered as "
                "it was seen from: give a scene folder, an ABI file, or a file that "
                "cloudjax rendered for an ABI."
            )
        if band.band is None:
            raise DataError(
                f"{name} has a band {number} that is not ABI's: leave it out with "
                "--bands, or give imagery of ABI."
            )


def _lit(radiances, grid: FixedGrid, time: datetime, name: str):
    """The bands that see something, and a sentence on the others."""
    dark = [n for n, b in radiances.items() if b.band.reflective]
    if not dark or shows_sunlit_clouds(sun_heights_deg(grid, time)):
        return radiances, ()
    left = {n: b for n, b in radiances.items() if n not in dark}
    numbers = ", ".join(map(str, dark))
    if not left:
        raise DataError(
            f"{name} is dark, so that bands {numbers} see no cloud: choose bands of 7 "
            "to 16 with --bands."
        )
    return left, (
        f"Left out, because the sun is below {LOWEST_SUN_DEG:g} degrees: "
        f"bands {numbers}.",
    )


def _of_resolution(grid: FixedGrid, asked_km: float | None, name: str) -> FixedGrid:
    if asked_km is None:
        return grid
    step = asked_km * RAD_PER_KM / grid.step_rad
    factor = round(step)
    if factor < 1 or abs(step - factor) > 1e-3 * factor or factor > min(grid.shape):
        raise DataError(
            f"{name} has pixels of {grid.step_rad / RAD_PER_KM:g} km in its coarsest "
            f"band, which do not fill those of {asked_km:g} km: give a multiple with "
            "--resolution-km, or finer bands alone with --bands."
        )
    rows, columns = (size // factor * factor for size in grid.shape)
    whole = replace(grid, y_rad=grid.y_rad[:rows], x_rad=grid.x_rad[:columns])
    return whole.coarsened(factor)


def _within(own, wanted, step_rad: float) -> np.ndarray:
    """Which angles are within the outer edges of others."""
    beyond = step_rad / 2
    inside = (own > wanted.min() - beyond) & (own < wanted.max() + beyond)
    return np.flatnonzero(inside)
