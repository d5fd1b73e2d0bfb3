"""One trial: a scene rendered at one quality, timed, and compared with a reference."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import wasserstein_distance

from cloudjax import Rays, Scene, render
from cloudjax_scenes.quality import Quality

from .outline import Outline


# The quickest of some: what else the machine does only ever adds.
_REPEATS = 4
# Every so many of the rays are timed, too, for what a render takes whatever its size.
_FEWER = 4
# Rays that are rendered at once. Of a sample few are read alike, as most of a tile of
# a whole image are: small tiles are filled up with less.
_TILE = 2048


@dataclass(frozen=True, eq=False)
class Subject:
    """A `Subject` is what is rendered in trials.

    **Fields:**

    - `name`: of the scene or sensor, and the options that make it.
    - `outline`: of the whole image.
    - `scene`: builds it at a quality.
    - `rays`: some of the image's, drawn at random.
    - `sun_direction`: unit vector from the Earth to the sun, ECEF.
    """

    name: str
    outline: Outline
    scene: Callable[[Quality], Scene]
    rays: Rays
    sun_direction: Float[np.ndarray, "3"]


@dataclass(frozen=True)
class BandError:
    """What a band's radiances are off by, over the standard deviation of the reference.

    **Fields:** `bias`, `rmse` pixel by pixel, and `w1`, the 1-Wasserstein distance of
    the distributions.
    """

    bias: float
    rmse: float
    w1: float


@dataclass(frozen=True)
class Trial:
    """A `Trial` is what one quality was measured to cost and to be worth.

    **Fields:**

    - `seconds`: for all pixels of the image, once compiled; of these `fixed_s` whatever
      its size.
    - `first_s`: that the first render of the sample took, which compiles.
    - `errors`: by band.
    """

    quality: Quality
    seconds: float
    fixed_s: float
    first_s: float
    errors: dict[int, BandError]

    @property
    def error(self) -> float:
        """The greatest RMSE of a band, over its standard deviation."""
        return max(error.rmse for error in self.errors.values())


@dataclass(frozen=True, eq=False)
class Rendered:
    """Radiances of a subject at one quality, and what they took."""

    quality: Quality
    radiances: dict[int, Float[np.ndarray, " rays"]]
    seconds: float
    fixed_s: float
    first_s: float

    def against(self, reference: "Rendered") -> Trial:
        """Compare with a render that is taken for true."""
        errors = {
            number: band_error(seen, reference.radiances[number])
            for number, seen in self.radiances.items()
        }
        return Trial(self.quality, self.seconds, self.fixed_s, self.first_s, errors)


def rendered(
    subject: Subject, quality: Quality, *, repeats: int = _REPEATS
) -> Rendered:
    """Render the subject's rays at a quality, and time it once compiled.

    With products, as images are rendered into files.

    **Arguments:** `repeats`: of what is timed.
    """
    began = time.perf_counter()
    scene = subject.scene(quality)

    def values(rays: Rays) -> Float[np.ndarray, "bands rays"]:
        image = render(
            scene, rays, subject.sun_direction, tile=_TILE, with_products=True
        )
        return np.asarray(scene.total(image.radiances), np.float64)

    few, many = subject.rays[::_FEWER], subject.rays
    radiances = dict(zip(scene.bands, values(many), strict=True))
    first_s = time.perf_counter() - began
    values(few)
    timed = [
        (len(rays), _quickest(lambda r=rays: values(r), repeats))
        for rays in (few, many)
    ]
    fixed_s, pixel_s = _line(*timed)
    seconds = fixed_s + pixel_s * subject.outline.pixels
    return Rendered(quality, radiances, seconds, fixed_s, first_s)


def _line(few: tuple[int, float], many: tuple[int, float]) -> tuple[float, float]:
    """What a render takes whatever its size, and what each pixel does, of two renders.

    Of each the pixels and seconds. Most is by pixel, whatever a noisy clock says.
    """
    (n, few_s), (m, many_s) = few, many
    pixel_s = (many_s - few_s) / (m - n) if m > n else 0.0
    pixel_s = min(max(pixel_s, 0.5 * many_s / m), many_s / m)
    return many_s - m * pixel_s, pixel_s


def _quickest(work: Callable[[], object], repeats: int) -> float:
    took = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        took.append(time.perf_counter() - start)
    return min(took)


def band_error(
    seen: Float[np.ndarray, " rays"], true: Float[np.ndarray, " rays"]
) -> BandError:
    """Measure how far radiances are from the true ones; in shares of their deviation.

    Where the true ones do not vary, as at night in bands of the sun, they are 0 where
    both agree.
    """
    off = seen - true
    spread = max(float(true.std()), float(np.finfo(np.float32).tiny))
    return BandError(
        bias=float(off.mean()) / spread,
        rmse=float(np.sqrt((off**2).mean())) / spread,
        w1=float(wasserstein_distance(seen, true)) / spread,
    )
