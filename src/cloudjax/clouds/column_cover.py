"""How much of the sky a class of cloud covers under a mask, and which mask covers it.

Seen from above a column is cloudy where the way through its cloud is thick enough. The
noise in a column is Gaussian, with a covariance that the ladders give; barriers,
threshold, mask, extinction and the steps of the march do the rest. So the cover under
any mask is a mean over such columns. It hangs on no pixel, for what a pixel averages
away widens the level set.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from cloudjax.geometry.latlon_grid import AnyArray

from .classes import CloudClass
from .ladder import rungs


# Optical depth at which imagers begin to call a pixel cloudy.
VISIBLE_DEPTH = 0.3
# Columns, a power of 2, and levels at which their cover is found.
_COLUMNS = 2048
_LEVELS = 97
# As the march has them: width of the level set without footprint, and the change within
# a step that is as good as a jump.
_SMOOTHING, _MOST_CHANGE = 0.02, 6.0
# Nodes of the table, in equal steps of the probit of cover, and where it ends: a column
# in a thousand is too rare to be counted.
_NODES = 65
_LEAST = 2e-3
# A clear sky is one of so little cloud, where the mask and its slope are finite; less
# than the march would see.
_CLEAR = 1e-6


@dataclass(frozen=True, eq=False)
class ColumnCover:
    """A `ColumnCover` is the cover of a class of cloud under a uniform mask, as a
    table.

    **Fields:**

    - `probit`: Φ⁻¹ of cover over the greatest cover, ascending.
    - `mask`: w, ascending.
    - `greatest`: cover under the greatest mask; less than 1 where the shell holds no
      more than a thin cloud.
    """

    probit: Float[AnyArray, " nodes"]
    mask: Float[AnyArray, " nodes"]
    greatest: float | Float[Array, ""]

    @staticmethod
    def of(one: CloudClass, steps: int = 24) -> "ColumnCover":
        """Find it for a class.

        **Arguments:** `steps`: of the march; few of them blur edges and cover more.

        **Raises:** `ValueError` for a mask gain of 0, for then no mask counts.
        """
        if not one.mask_gain > 0:
            raise ValueError(f"mask_gain of {one.name} must be positive.")
        excess = _excess(one, steps)
        width = np.sqrt(_SMOOTHING**2 + _spread(excess))
        shell = one.marched
        depth = one.extinction_per_m * (shell.top_m - shell.bottom_m) / steps
        highest = excess.max(axis=1)
        levels = np.linspace(highest.max() + 1, highest.min() - 1, _LEVELS)
        cover = np.array(
            [_seen(depth * ndtr((excess - u) / width).sum(1)).mean() for u in levels]
        )
        greatest = float(_seen(depth * steps))
        part = np.maximum.accumulate(cover / greatest)
        probit = np.linspace(ndtri(_LEAST), -ndtri(_LEAST), _NODES)
        # Rising, for numpy, where cover stays the same.
        rising = ndtri(np.clip(part, 1e-9, 1 - 1e-9)) + 1e-9 * np.arange(_LEVELS)
        level = np.interp(probit, rising, levels)
        return ColumnCover(probit, (one.threshold - level) / one.mask_gain, greatest)

    def mask_of(self, cover: Float[AnyArray, "*n"]) -> Float[AnyArray, "*n"]:
        """Return the mask under which the class covers so much; NaN counts as clear.

        It is monotone and differentiable; numpy in, numpy out. Beyond the table it is
        linear in the probit, as a Gaussian has it.
        """
        xp = np if isinstance(cover, np.ndarray) else jnp
        part = xp.clip(xp.nan_to_num(cover) / self.greatest, 0.0, 1.0)
        inverse = ndtri if xp is np else jax.scipy.special.ndtri
        probit = inverse(_CLEAR + (1 - 2 * _CLEAR) * part)
        return _line(probit, self.probit, self.mask)

    def cover_of(self, mask: Float[AnyArray, "*n"]) -> Float[Array, "*n"]:
        """Return the cover under a mask."""
        return self.greatest * jax.scipy.special.ndtr(
            _line(jnp.asarray(mask, float), self.mask, self.probit)
        )


def _line(x, nodes, values):
    """Linear between nodes, and on from the outermost two of some distance."""
    xp = np if all(isinstance(a, np.ndarray) for a in (x, nodes, values)) else jnp
    inner = xp.interp(x, nodes, values)
    few = len(nodes) // 8
    low = (values[few] - values[0]) / xp.maximum(nodes[few] - nodes[0], 1e-9)
    wide = xp.maximum(nodes[-1] - nodes[-1 - few], 1e-9)
    high = (values[-1] - values[-1 - few]) / wide
    below = xp.minimum(x - nodes[0], 0.0)
    return inner + low * below + high * xp.maximum(x - nodes[-1], 0.0)


def _seen(depth):
    """How much of a pixel of this optical depth counts as cloud."""
    return 1 - 1 / (1 + (depth / VISIBLE_DEPTH) ** 2)


def _excess(one: CloudClass, steps: int) -> Float[np.ndarray, "columns steps"]:
    """The noise less the barriers in the steps of many columns."""
    shell = one.marched
    step = (shell.top_m - shell.bottom_m) / steps
    altitude = shell.bottom_m + step * (np.arange(steps) + 0.5)
    values, vectors = np.linalg.eigh(_covariance(one, altitude))
    root = vectors * np.sqrt(np.maximum(values, 0))
    # `rng` of scipy 1.15 has that name in no earlier one.
    sobol = qmc.Sobol(steps, seed=0)  # pyright: ignore[reportCallIssue]
    uniform = sobol.random(_COLUMNS)
    noise = ndtri(np.clip(uniform, 1e-9, 1 - 1e-9)) @ root.T
    below = np.exp(np.minimum((one.base_m - altitude) / one.barrier_scale_m, 30.0))
    above = np.exp(np.minimum((altitude - one.top_m) / one.barrier_scale_m, 30.0))
    return noise - below - above


def _spread(
    excess: Float[np.ndarray, "columns steps"],
) -> Float[np.ndarray, "columns steps"]:
    """Variance within each step, as the march has it: (change)²/12."""
    if excess.shape[1] == 1:
        return np.zeros_like(excess)
    change = np.gradient(excess, axis=1)
    return np.minimum(np.abs(change), _MOST_CHANGE) ** 2 / 12


def _covariance(
    one: CloudClass, altitude_m: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n n"]:
    """Of the noise at two heights: a wave k of random direction leaves sin(kd)/(kd)."""
    cloud = one.cloud(seed=0)
    apart = np.abs(altitude_m[:, None] - altitude_m[None])
    found = np.zeros(apart.shape)
    amplitudes = cloud.function.amplitudes(cloud.ladders)
    for amplitude, rung in zip(amplitudes, rungs(cloud.ladders), strict=True):
        for k, power in zip(*rung.spectrum, strict=True):
            found += float(amplitude) ** 2 * power * np.sinc(k * apart / np.pi)
    return found
