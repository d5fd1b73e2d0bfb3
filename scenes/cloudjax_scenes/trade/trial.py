"""One trial: a scene rendered at one quality, timed, and compared with a reference."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import wasserstein_distance

from cloudjax import Rays, Scene, render
from cloudjax_scenes.quality import Quality


# The quicker of two: what else the machine does only ever adds.
_REPEATS = 2


@dataclass(frozen=True, eq=False)
class Subject:
    """A `Subject` is what is rendered in trials.

    **Fields:**

    - `name`: of the scene or sensor, and the options that make it.
    - `kind`: of scene, for which one front serves.
    - `scene`: builds it at a quality.
    - `rays`: some of the image's, drawn at random; `pixels`: of the whole image.
    - `sun_direction`: unit vector from the Earth to the sun, ECEF.
    """

    name: str
    kind: str
    scene: Callable[[Quality], Scene]
    rays: Rays
    sun_direction: Float[np.ndarray, "3"]
    pixels: int


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

    - `seconds`: for all pixels of the image, once compiled.
    - `first_s`: that the first render of some pixels took, which compiles.
    - `errors`: by band.
    """

    quality: Quality
    seconds: float
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
    first_s: float

    def against(self, reference: "Rendered") -> Trial:
        """Compare with a render that is taken for true."""
        errors = {
            number: band_error(seen, reference.radiances[number])
            for number, seen in self.radiances.items()
        }
        return Trial(self.quality, self.seconds, self.first_s, errors)


def rendered(subject: Subject, quality: Quality) -> Rendered:
    """Render the subject's rays at a quality, and time it once compiled."""
    began = time.perf_counter()
    scene = subject.scene(quality)

    def once() -> tuple[Float[np.ndarray, "bands rays"], float]:
        start = time.perf_counter()
        image = render(
            scene, subject.rays, subject.sun_direction, tile=len(subject.rays)
        )
        values = np.asarray(scene.total(image.radiances), np.float64)
        return values, time.perf_counter() - start

    values, _ = once()
    first_s = time.perf_counter() - began
    took = [once()[1] for _ in range(_REPEATS)]
    radiances = dict(zip(scene.bands, values, strict=True))
    share = subject.pixels / len(subject.rays)
    return Rendered(quality, radiances, min(took) * share, first_s)


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
