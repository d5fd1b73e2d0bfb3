"""Rungs are read from noise along ways, many at once."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from cloudjax.geometry.path import middles

from .fractal_path import FractalPath
from .fractal_samples import Reading
from .noise import NoiseBands


class NoiseOfRungs(eqx.Module):
    """What the rungs of a cloud are read from.

    **Fields:**

    - `noise`: of all rungs, and `band`: that of each.
    - `frames`: how positions [m] become positions in the noise [periods].
    - `wavenumbers`, `powers`: nodes of each rung's spectrum: radians per metre, and the
      variance that each stands for.
    - `wave_m`: mean wavelength of each rung.
    """

    noise: NoiseBands
    band: Int[Array, " rungs"]
    frames: Float[Array, "rungs 3 3"]
    wavenumbers: Float[Array, "rungs nodes"]
    powers: Float[Array, "rungs nodes"]
    wave_m: Float[Array, " rungs"]


class RungReader(eqx.Module):
    """A `RungReader` reads rungs along ways, averaged over pixels.

    **Fields:** `amplitude`: that pixels leave of each rung; `ladder_of`: each rung.
    """

    way: FractalPath
    textures: NoiseOfRungs
    amplitude: Float[Array, "rungs rays"]
    ladder_of: tuple[int, ...] = eqx.field(static=True)

    def values(self, some: tuple[int, ...], count: int) -> Reading:
        """Read some rungs at so many points."""
        value = self.textures.noise.sample(*self._places(some, count))
        return self._averaged(some, value)

    def with_gradient(
        self, some: tuple[int, ...], count: int
    ) -> tuple[Reading, Reading]:
        """Read some rungs at so many points, and their gradients [1/m], ECEF."""
        noise = self.textures.noise
        value, per_period = noise.sample_with_gradient(*self._places(some, count))
        frames = self.textures.frames[np.array(some)]
        averaged = self.amplitude[np.array(some)][None, ..., None] * per_period
        upwind = jnp.einsum("ikrp,kia->rkap", averaged, frames, precision="highest")
        ladders = tuple(self.ladder_of[i] for i in some)
        gradient = Reading(self.way.drawn(ladders, upwind), some)
        return self._averaged(some, value), gradient

    def _places(self, some: tuple[int, ...], count: int):
        ladders = tuple(self.ladder_of[i] for i in some)
        frames = self.textures.frames[np.array(some)]
        band = self.textures.band[np.array(some)]
        return band, self.way.positions(some, ladders, frames, middles(count))

    def _averaged(
        self, some: tuple[int, ...], value: Float[Array, "read rays points"]
    ) -> Reading:
        """Rays first."""
        averaged = self.amplitude[np.array(some)][..., None] * value
        return Reading(jnp.swapaxes(averaged, 0, 1), some)
