"""Cloud cover of an image beside that of an analysis: means, by latitude, patterns."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from cloudjax.geometry.geodesy import MEAN_RADIUS_M
from cloudjax_fit.plain_data import plain
from cloudjax_scenes.weather_evidence import layers_by_pressure


Pixels = Float[np.ndarray, " pixels"]
# In the order in which they are shown.
KINDS = ("total", "high", "middle", "low")
BAND_DEG, BOX_DEG = 10.0, 2.5
# Boxes that are seen less are left out of patterns, and so are patterns of few boxes.
_LEAST_SEEN, _LEAST_BOXES = 0.5, 10


def seen_covers(
    fraction: Pixels, top_hpa: Pixels, latitude_deg: Pixels
) -> dict[str, Pixels]:
    """Return what each pixel shows of all cloud, and of high, middle and low cloud by
    the pressure at its top.
    """
    within = layers_by_pressure(top_hpa, latitude_deg)
    layers = {name: np.where(held, fraction, 0.0) for name, held in within.items()}
    return {"total": fraction, **layers}


@dataclass(frozen=True, eq=False)
class CoverPair:
    """A `CoverPair` is one cover of an image and of the analysis, over one area.

    **Fields:** `image`, `told`: 0 to 1.
    """

    image: float
    told: float

    @property
    def points(self) -> float:
        """Give by how many points of per cent the image has more."""
        return 100 * (self.image - self.told)


@dataclass(frozen=True, eq=False)
class LatitudeBand:
    """A `LatitudeBand` has the covers between two latitudes, by kind.

    **Fields:** `share`: of the area that is compared.
    """

    south_deg: float
    north_deg: float
    share: float
    covers: Mapping[str, CoverPair]


@dataclass(frozen=True, eq=False)
class Covers:
    """`Covers` are those of an image and of the analysis over the same places.

    **Fields:**

    - `whole`: by kind, of all pixels.
    - `by_latitude`: from the north.
    - `correlation`: by kind, of means over boxes of 2.5 degrees, NaN for few boxes.
    - `boxes`: how many.
    - `independent`: the analysis's cover, were its layers independent.
    - `topless`: of the image's cover, that of pixels with too little to have a top.
    """

    whole: Mapping[str, CoverPair]
    by_latitude: tuple[LatitudeBand, ...]
    correlation: Mapping[str, float]
    boxes: int
    independent: float
    topless: float

    def numbers(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        return {
            "whole": _plain(self.whole),
            "by_latitude": [
                {"south_deg": b.south_deg, "north_deg": b.north_deg, "share": b.share}
                | {"covers": _plain(b.covers)}
                for b in self.by_latitude
            ],
            "correlation": plain(self.correlation),
            "boxes": self.boxes,
            "analysis_if_independent": self.independent,
            "image_without_top": self.topless,
        }


def compare_covers(
    image: Mapping[str, Pixels],
    told: Mapping[str, Pixels],
    independent: Pixels,
    latitude_deg: Pixels,
    longitude_deg: Pixels,
    area_m2: Pixels,
) -> Covers:
    """Compare covers by kind, pixels weighted by the ground that they take."""

    def pairs(within) -> dict[str, CoverPair]:
        of = area_m2[within]
        return {
            kind: CoverPair(
                *(float(np.average(x[kind][within], weights=of)) for x in (image, told))
            )
            for kind in KINDS
        }

    bands = []
    for south in np.arange(90 - BAND_DEG, -90 - BAND_DEG / 2, -BAND_DEG):
        north = south + BAND_DEG
        within = (latitude_deg >= south) & (latitude_deg < north)
        if within.any():
            share = float(area_m2[within].sum() / area_m2.sum())
            bands.append(LatitudeBand(float(south), float(north), share, pairs(within)))
    boxes = _Boxes(latitude_deg, longitude_deg, area_m2)
    everywhere = np.ones(area_m2.shape, bool)
    layered = sum((image[kind] for kind in KINDS[1:]), np.zeros(area_m2.shape))
    return Covers(
        whole=pairs(everywhere),
        by_latitude=tuple(bands),
        correlation={k: boxes.correlation(image[k], told[k]) for k in KINDS},
        boxes=boxes.count,
        independent=float(np.average(independent, weights=area_m2)),
        topless=float(np.average(image["total"] - layered, weights=area_m2)),
    )


def class_covers(
    fraction: Pixels,
    cloud_class: Int[np.ndarray, " pixels"],
    class_names: Sequence[str],
    area_m2: Pixels,
) -> dict[str, float]:
    """Return the cover of the pixels in which each class stops the most light, of the
    whole area.
    """
    return {
        name.replace("_", " "): float(
            np.average(fraction * (cloud_class == number), weights=area_m2)
        )
        for number, name in enumerate(class_names, 1)
    }


class _Boxes:
    """Boxes of latitude and longitude of which the image shows at least half."""

    def __init__(self, latitude_deg, longitude_deg, area_m2):
        rows, columns = int(180 / BOX_DEG), int(360 / BOX_DEG)
        row = np.minimum((latitude_deg + 90) / BOX_DEG, rows - 1).astype(int)
        column = (np.mod(longitude_deg, 360) / BOX_DEG).astype(int) % columns
        self.box, self.size = row * columns + column, rows * columns
        self.weight = area_m2
        self.seen_m2 = np.bincount(self.box, area_m2, self.size)
        edges = np.sin(np.radians(np.linspace(-90, 90, rows + 1)))
        whole = MEAN_RADIUS_M**2 * np.radians(BOX_DEG) * np.diff(edges)
        self.kept = self.seen_m2 >= _LEAST_SEEN * np.repeat(whole, columns)

    @property
    def count(self) -> int:
        return int(self.kept.sum())

    def correlation(self, one: Pixels, other: Pixels) -> float:
        """Of means over boxes, each of the weight of its area."""
        if self.count < _LEAST_BOXES:
            return float("nan")
        weight = self.seen_m2[self.kept]
        a, b = (self._anomaly(values, weight) for values in (one, other))
        spread = np.sqrt((weight * a * a).sum() * (weight * b * b).sum())
        return float((weight * a * b).sum() / spread) if spread > 0 else float("nan")

    def _anomaly(self, values: Pixels, weight):
        sums = np.bincount(self.box, self.weight * values, self.size)[self.kept]
        means = sums / weight
        return means - np.average(means, weights=weight)


def _plain(covers: Mapping[str, CoverPair]) -> dict[str, dict[str, float]]:
    return {
        kind: {"image": pair.image, "analysis": pair.told, "points": pair.points}
        for kind, pair in covers.items()
    }
