"""Images that stay as they are."""

import numpy as np

from .scenes import fractal_image, image_of
from .stored import share


def test_the_image_of_a_fractal_scene_stays(stored):
    """Mean and quantiles of all pixels, and some pixels. Allowed: 2e-4 of the largest,
    which other orders of summation do not reach."""
    image = fractal_image()
    found = {
        name: np.array([values.mean(), *np.percentile(values, [10, 50, 90])])
        for name, values in image.items()
    } | {f"{name} pixels": values[:100] for name, values in image.items()}
    stored.check("fractal_image", found, share(found, 2e-4))


def test_the_image_over_a_generated_analysis_stays(stored, rendered):
    """One pixel of 64 of the image that the command line renders over a GRIB file.

    Allowed: 1e-3 of the largest value of a quantity, for a step's texture may be read
    one voxel further where rounding tips it.
    """
    found = image_of(rendered)
    stored.check("image_over_weather", found, share(found, 1e-3))
