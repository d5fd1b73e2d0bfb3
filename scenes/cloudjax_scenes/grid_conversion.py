"""The fixed grid of files as that of the renderer, and back."""

import numpy as np

import cloudjax
import cloudjax_data
from cloudjax import Ellipsoid


def renderer_grid(grid: cloudjax_data.FixedGrid) -> cloudjax.FixedGrid:
    """Return the fixed grid of a file as that of the renderer."""
    return cloudjax.FixedGrid(
        x_rad=grid.x_rad,
        y_rad=grid.y_rad,
        subsatellite_longitude_deg=grid.subsatellite_longitude_deg,
        perspective_height_m=grid.perspective_height_m,
        ellipsoid=Ellipsoid(grid.semi_major_axis_m, grid.semi_minor_axis_m),
        sweep=grid.sweep,
    )


def data_grid(grid: cloudjax.FixedGrid) -> cloudjax_data.FixedGrid:
    """Return the renderer's fixed grid as that of the files."""
    return cloudjax_data.FixedGrid(
        x_rad=np.asarray(grid.x_rad, np.float64),
        y_rad=np.asarray(grid.y_rad, np.float64),
        subsatellite_longitude_deg=grid.subsatellite_longitude_deg,
        perspective_height_m=grid.perspective_height_m,
        semi_major_axis_m=grid.ellipsoid.semi_major_m,
        semi_minor_axis_m=grid.ellipsoid.semi_minor_m,
        sweep=grid.sweep,
    )
