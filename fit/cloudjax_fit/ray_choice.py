"""Which pixels of an image a fit simulates: clusters of neighbours.

A cluster is an anchor and the pixels that are one lag away from it, in its row and in
its column. Each pixel of one is of use for radiances and for increments: the sample is
nearly as good for histograms of radiances as independent pixels (docs/statistics.md).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from .targets import Target


# Towards which an anchor may have its cluster, down and to the right.
_DIRECTIONS = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])
# Of the clouds, that clusters see in turn (docs/decisions.md).
DRAWS = 8
# Tried in each part of an image.
_ANCHORS = 8


@dataclass(frozen=True, eq=False)
class RayChoice:
    """Pixels that are simulated.

    **Fields:**

    - `pixels`: their numbers; `known`: 1 for each that counts.
    - `pairs`: places in `pixels` of two that are a lag apart, by lag.
    - `lags`: none where no neighbours are chosen.
    """

    pixels: Int[np.ndarray, " rays"]
    known: Float[np.ndarray, " rays"]
    pairs: list[Int[np.ndarray, "2 _"]]
    lags: tuple[int, ...]

    @property
    def draw(self) -> Int[np.ndarray, " rays"]:
        """Tell which draw of the clouds each pixel sees: that of the anchor of its
        cluster, whatever else is chosen.
        """
        members = 2 * len(self.lags) + 1
        return np.repeat(self.pixels[::members] % DRAWS, members)


def draw_rays(target: Target, count: int, seed: int, *, texture: bool) -> RayChoice:
    """Choose pixels among all that count, clusters of neighbours where texture is
    compared.
    """
    rng = np.random.default_rng(seed)
    lags = target.statistics.lags if texture else ()
    members = 2 * len(lags) + 1
    good = target.good & target.imagery.grid.sees_the_earth()
    if lags and count >= members:
        found = _clusters(good, lags, count // members, rng)
        if found is not None:
            return _of_clusters(found, count // members, lags)
    pixels = np.sort(rng.permutation(np.flatnonzero(good))[:count])
    return RayChoice(pixels, np.ones(len(pixels)), [], ())


def _clusters(good, lags, count: int, rng) -> Int[np.ndarray, "some members"] | None:
    """Numbers of the pixels of clusters; None where no cluster is all good.

    Anchors are spread evenly over the pixels, each with its own directions along rows
    and columns, so that no side of the image is left out.
    """
    candidates = np.flatnonzero(good)
    found = []
    # One of each of so many equal parts of the image's pixels, in their order.
    for part in np.array_split(candidates, min(count, len(candidates))):
        tries = (
            _cluster(good, int(anchor), lags, direction)
            for anchor in rng.permutation(part)[:_ANCHORS]
            for direction in rng.permutation(_DIRECTIONS)
        )
        cluster = next((one for one in tries if one is not None), None)
        if cluster is not None:
            found.append(cluster)
    return np.array(found) if found else None


def _cluster(good, anchor: int, lags, direction) -> Int[np.ndarray, " members"] | None:
    """Numbers of the pixels of one cluster; None where one of them does not count."""
    (rows, columns), (y, x) = good.shape, divmod(anchor, good.shape[1])
    ys, xs = (
        at + sign * np.array(lags) for at, sign in zip((y, x), direction, strict=True)
    )
    if not (0 <= ys[-1] < rows and 0 <= xs[-1] < columns):
        return None
    if not (good[ys, x].all() and good[y, xs].all()):
        return None
    return np.array([anchor, *(ys * columns + x), *(y * columns + xs)])


def _of_clusters(
    clusters: Int[np.ndarray, "clusters members"], count: int, lags: tuple[int, ...]
) -> RayChoice:
    """Pixels and pairs of clusters, filled up to a number that depends on no image."""
    known = np.arange(count) < len(clusters)
    clusters, members = clusters[np.arange(count) % len(clusters)], clusters.shape[1]
    place = np.arange(count * members).reshape(count, members)
    anchor, arms = place[:, :1], np.split(place[:, 1:], 2, axis=1)
    pairs = []
    for i in range(len(lags)):
        # From the anchor to the lag, and from there to twice the lag.
        ends = [(0, i + 1), (i + 1, i + 2)][: 1 + (i + 1 < len(lags))]
        both = [
            np.stack([arm[:, a], arm[:, b]])
            for arm in (np.concatenate([anchor, one], axis=1) for one in arms)
            for a, b in ends
        ]
        pairs.append(_along_the_image(np.concatenate(both, axis=1), clusters))
    counts = np.repeat(known, members).astype(float)
    return RayChoice(clusters.reshape(-1), counts, pairs, lags)


def _along_the_image(
    pairs: Int[np.ndarray, "2 n"], clusters: Int[np.ndarray, "clusters members"]
) -> Int[np.ndarray, "2 n"]:
    """Turn pairs so that they go to the right and down, as those of images do.

    Increments have a sign, and images have slopes, of the sun's height alone.
    """
    return np.where(
        np.diff(clusters.reshape(-1)[pairs], axis=0) < 0, pairs[::-1], pairs
    )
