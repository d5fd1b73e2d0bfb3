"""The cover of a class of cloud under a mask is found, and the mask of a cover.

Seen from above a column is cloudy where the way through its cloud is thick enough. The
noise in a column is Gaussian, with a covariance that the ladders give; barriers,
threshold, mask, extinction and the steps of the march do the rest. So the cover under
any mask is a mean over such columns. It hangs on no pixel, for what a pixel averages
away widens the level set.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import ndtri
from scipy.stats import qmc

from cloudjax.geometry.latlon_grid import AnyArray

from .classes import CloudClass
from .cloud_function import CloudFunction
from .ladder import Ladder, rungs
from .level_set import Latent, level_set
from .visibility import unseen


# Columns, a power of 2, and levels at which their cover is found.
_COLUMNS = 2048
_LEVELS = 97
# Of the noise in a column; no march has many more steps.
_MODES = 256
# Nodes of the table, in equal steps of the probit of cover, and where it ends: a column
# in a thousand is too rare to be counted.
_NODES = 65
_LEAST = 2e-3
# A clear sky is one of so little cloud, where the mask and its slope are finite; less
# than the march would see.
_CLEAR = 1e-6


class ColumnCover(eqx.Module):
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
        cloud, shell = one.cloud(seed=0), one.marched
        step_m = (shell.top_m - shell.bottom_m) / steps
        altitude = shell.bottom_m + step_m * (np.arange(steps) + 0.5)
        noise = _noise(cloud.function, cloud.ladders, altitude)
        highest = _highest(cloud.function, noise, altitude)
        levels = np.linspace(highest.max() + 1, highest.min() - 1, _LEVELS)
        masks = (one.threshold - levels) / one.mask_gain
        depth = one.extinction_per_m * step_m
        cover = _covers(cloud.function, noise, altitude, masks, depth)
        greatest = float(1 - unseen(depth * steps))
        part = np.maximum.accumulate(cover / greatest)
        probit = np.linspace(ndtri(_LEAST), -ndtri(_LEAST), _NODES)
        # Rising, for numpy, where cover stays the same.
        rising = ndtri(np.clip(part, 1e-9, 1 - 1e-9)) + 1e-9 * np.arange(_LEVELS)
        return ColumnCover(probit, np.interp(probit, rising, masks), greatest)

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


def _noise(
    function: CloudFunction,
    ladders: tuple[Ladder, ...],
    altitude_m: Float[np.ndarray, " steps"],
) -> Float[np.ndarray, "columns steps"]:
    """The noise in the steps of many columns, the same ones whatever the steps.

    The modes of its covariance, greatest first, hardly depend on how finely they are
    sampled; so what chance makes of the cover does not either, and a march of more
    steps is compared with the same cloud.
    """
    covariance = _covariance(function, ladders, altitude_m)
    values, vectors = np.linalg.eigh(covariance)
    # A mode is given but for its sign.
    sign = np.where(vectors[0] < 0, -1, 1)
    root = (vectors * sign * np.sqrt(np.maximum(values, 0)))[:, ::-1]
    dimensions = max(len(altitude_m), _MODES)
    # `rng` of scipy 1.15 has that name in no earlier one.
    sobol = qmc.Sobol(dimensions, seed=0)  # pyright: ignore[reportCallIssue]
    uniform = sobol.random(_COLUMNS)[:, : len(altitude_m)]
    return ndtri(np.clip(uniform, 1e-9, 1 - 1e-9)) @ root.T


def _covariance(
    function: CloudFunction,
    ladders: tuple[Ladder, ...],
    altitude_m: Float[np.ndarray, " n"],
) -> Float[np.ndarray, "n n"]:
    """Of the noise at two heights: a wave k of random direction leaves sin(kd)/(kd)."""
    apart = np.abs(altitude_m[:, None] - altitude_m[None])
    found = np.zeros(apart.shape)
    for amplitude, rung in zip(
        function.amplitudes(ladders), rungs(ladders), strict=True
    ):
        for k, power in zip(*rung.spectrum, strict=True):
            found += float(amplitude) ** 2 * power * np.sinc(k * apart / np.pi)
    return found


def _highest(function, noise, altitude_m) -> Float[np.ndarray, " columns"]:
    """The mask must take so much from the threshold for cloud in each column."""
    value = _value(function, noise, altitude_m, 0.0)
    return np.asarray((value + function.threshold).max(axis=1), float)


@jax.jit
def _covers(function, noise, altitude_m, masks, depth) -> Float[Array, " masks"]:
    """The cover under each mask, by steps of this optical depth."""
    none = jnp.zeros(len(noise))
    # All noise is there: no pixel averages any of it away.
    latent, width = Latent.equal_shares(1), function.smoothing**2 + none

    def cover(mask):
        value = _value(function, noise, altitude_m, mask)
        _, fraction = level_set(value, none, width, latent)
        return 1 - unseen(depth * fraction[0].sum(-1)).mean()

    return jax.lax.map(cover, masks)


def _value(function, noise, altitude_m, mask):
    """CF in each step of each column."""
    mask, altitude_m = (jnp.broadcast_to(x, noise.shape) for x in (mask, altitude_m))
    return function(jnp.asarray(noise, float), mask, altitude_m)
