"""Columns of a model get detail below them: fractal, and with the same mean.

A model's cell knows one content. Within it the content of real cloud varies, and nearly
as a lognormal; so it is multiplied by

    F = exp(f - σ²/2),  f = Σ_o a_o N_o,

a ladder of noise from the width of the columns down, of the variance σ². The mean of F
is 1 wherever and at whatever resolution: the variance that a pixel takes from f leaves
the exponent as well, in part as structures of the pixel (nodes).
"""

import math
from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.footprint import Sampling
from cloudjax.geometry.path import Path, Profile
from cloudjax.geometry.rays import Rays
from cloudjax.geometry.shells import Chords, Shell

from .cloud_function import CloudFunction
from .column_path import ColumnPath, ColumnSamples
from .columns import AbstractColumns
from .fractal import FractalCloud
from .fractal_path import FractalPath
from .fractal_samples import FractalSamples
from .ladder import Ladder, amplitudes, rungs, seed_of_draw
from .level_set import Latent
from .noise import Gaussian, Noise
from .rung_reader import NoiseOfRungs
from .source import AbstractCloudSource, Occupancy, Slopes


# Of cloud water in grid boxes of climate models, some 100 km wide: standard deviation
# over mean (Shonk et al. 2010, Q. J. R. Meteorol. Soc. 136, 1191).
_FRACTIONAL, _WIDTH_M = 0.75, 100e3


def usual_spread(width_m: float) -> float:
    """Return the standard deviation of the logarithm of content below a width [m].

    With a spectrum of k^(-5/3) variance below a scale goes with its power of 2/3; and
    a lognormal of the fractional deviation f has σ² = ln(1 + f²).
    """
    fractional = _FRACTIONAL * (min(width_m, _WIDTH_M) / _WIDTH_M) ** (1 / 3)
    return math.sqrt(math.log1p(fractional**2))


def width_for_detail_m(grid: ColumnGrid, shortest_m: float) -> float:
    """Return the width of columns, which waves of detail are no longer than.

    **Raises:** `ValueError` where the columns are narrower than the shortest wave.
    """
    width = float(max(abs(d) for d in grid.spacing_m))
    # Written so that NaN fails.
    if not 1 <= shortest_m <= width:
        raise ValueError(
            f"Detail down to {shortest_m:g} m is none of the columns, "
            f"{width:g} m wide: make it 1 m or more, and finer than they are."
        )
    return width


class DetailedPath(eqx.Module):
    """A `DetailedPath` is a ray's way through columns, and through the noise."""

    columns: ColumnPath
    noise: FractalPath

    @property
    def path(self) -> Path:
        """Give the geometry."""
        return self.columns.path


class DetailedSamples(eqx.Module):
    """What columns and noise are along rays."""

    columns: ColumnSamples
    noise: FractalSamples

    @property
    def path(self) -> Path:
        """Give the geometry."""
        return self.columns.path

    @property
    def index(self) -> Float[Array, "rays 2 steps"]:
        """Give row and column in the middle of each step."""
        return self.columns.index

    def on(self, path: Path, at: Float[Array, "rays points"]) -> "DetailedSamples":
        """Place both at parts of the chord, 0 to 1, as if at another path's steps."""
        return DetailedSamples(self.columns.on(path, at), self.noise.on(path, at))


class DetailedColumns(AbstractCloudSource):
    """Columns whose content varies within their cells; make it with `of`.

    **Fields:**

    - `columns`: the model's.
    - `spread`: σ, standard deviation of the logarithm of the content.
    - `persistence`: amplitude of an octave over that of the next longer one; 2^(-1/3)
      is the spectrum of turbulence, k^(-5/3).
    - `latent`: the quadrature over what a pixel does not resolve.
    - `ladder`: of the noise.
    - `seed`: by which its rungs are turned and shifted.
    - `thickness_m`: a usual one of cloud, over which structure of a pixel is common.
    """

    columns: AbstractColumns
    spread: Float[Array, ""]
    persistence: Float[Array, ""]
    latent: Latent
    shell: Shell = eqx.field(static=True)
    ladder: Ladder = eqx.field(static=True)
    seed: int = eqx.field(static=True, default=0)
    thickness_m: float = eqx.field(static=True, default=1000.0)

    @classmethod
    def of(
        cls,
        columns: AbstractColumns,
        shortest_m: float,
        *,
        spread: float | None = None,
        noise: Noise | None = None,
        seed: int = 0,
        nodes: int = 3,
    ) -> "DetailedColumns":
        """Give columns detail from their own width down to a wavelength.

        **Arguments:** `spread`: by default `usual_spread` of the width; `noise`: by
        default Gaussian, so that content is lognormal.

        **Raises:** `ValueError` where the columns are narrower than that wavelength.
        """
        width = width_for_detail_m(columns.grid, shortest_m)
        spread = usual_spread(width) if spread is None else spread
        return cls(
            columns=columns,
            spread=jnp.asarray(spread, float),
            persistence=jnp.asarray(2 ** (-1 / 3), float),
            latent=Latent.gauss_hermite(nodes),
            shell=columns.shell,
            ladder=Ladder(noise or Gaussian(), width, shortest_m),
            seed=seed,
        )

    @property
    def extinction_per_m(self) -> float:
        """Give the extinction of the layer, which an occupancy of 1 has."""
        return self.columns.extinction_per_m

    def drawn_anew(self, number: int) -> "DetailedColumns":
        """Return the same columns with the detail of another seed."""
        return replace(self, seed=seed_of_draw(self.seed, number))

    def make_textures(self) -> NoiseOfRungs:
        """Make what the rungs are read from."""
        return self._fractal.make_textures()

    def points(self, sampling: Sampling) -> tuple[int, ...]:
        """Say at how many points of a chord each rung is read."""
        return self._fractal.points(sampling)

    def navigate(self, rays: Rays, chord: Chords, sampling: Sampling) -> DetailedPath:
        """Lay rays over the map and through the noise, on the host in float64."""
        return DetailedPath(
            self.columns.navigate(rays, chord, sampling),
            self._fractal.navigate(rays, chord, sampling),
        )

    def likelihood(
        self, samples: DetailedPath | DetailedSamples
    ) -> Float[Array, " rays"]:
        """Count rays that pass over the columns as ones that may meet cloud."""
        return self.columns.likelihood(samples.columns)

    def sample(
        self, way: DetailedPath, textures: NoiseOfRungs, *, steps: int, slopes: bool
    ) -> DetailedSamples:
        """Find columns and read the noise along the ways."""
        return DetailedSamples(
            self.columns.sample(way.columns, (), steps=steps, slopes=slopes),
            self._fractal.sample(way.noise, textures, steps=steps, slopes=slopes),
        )

    def branch(
        self,
        way: DetailedPath,
        textures: NoiseOfRungs,
        distance_m: Float[Array, " rays"],
        direction: Float[Array, "rays 3"],
        ends_m: Float[Array, "rays ends"],
    ) -> DetailedPath:
        """Leave the ways in another direction."""
        left = distance_m, direction, ends_m
        return DetailedPath(
            self.columns.branch(way.columns, (), *left),
            self._fractal.branch(way.noise, textures, *left),
        )

    def occupancy(self, samples: DetailedSamples, steps: int) -> Occupancy:
        """Multiply the cloud of each step by F, structure by structure."""
        found = self.columns.occupancy(samples.columns, steps)
        own = amplitudes(
            (self.ladder,),
            self.spread[None],
            self.persistence[None],
            jnp.ones(len(self.ladder.octaves)),
        )
        noise = samples.noise
        power = jnp.asarray([rung.power for rung in rungs((self.ladder,))], float)
        common, rest = (
            jnp.matmul(part, own**2, precision="highest")
            for part in (noise.common, noise.own)
        )
        left = jnp.maximum((own**2 * power).sum() - rest, 0.0)
        # The floor keeps the slope of the root finite where nothing is lost.
        shift = jnp.sqrt(jnp.maximum(common, 1e-12))[None, :, None]
        nodes = self.latent.nodes[:, None, None]
        field = noise.fractal(own, steps)[None] + nodes * shift
        factor = jnp.exp(field - (left / 2)[None, :, None])
        fraction = found.fraction[:, None] * factor[None]
        weights = found.weights[:, None] * self.latent.weights[None]
        slopes = None
        if found.slopes is not None:
            slopes = self._slopes(found, factor, noise.gradient(own))
        return Occupancy(
            fraction.reshape(-1, *fraction.shape[2:]), weights.reshape(-1), slopes
        )

    def _slopes(self, found: Occupancy, factor, gradient) -> Slopes:
        """∇(ρF) = F (∇ρ + ρ ∇f), the mean over structures."""
        assert found.slopes is not None
        steps = factor.shape[-1]
        mean = jnp.tensordot(self.latent.weights, factor, axes=1)
        dense = jnp.tensordot(found.weights, found.fraction, axes=1)
        steep = jnp.stack([Profile(axis).in_steps(steps) for axis in gradient])
        held = found.slopes
        return Slopes(
            mean[None] * (held.gradient + dense[None] * steep),
            mean * held.rise,
            held.up,
            held.unresolved,
        )

    @property
    def _fractal(self) -> FractalCloud:
        """The reader of the noise. Its cloud function is not asked for anything."""
        one, none = jnp.ones(()), jnp.zeros(())
        return FractalCloud(
            function=CloudFunction(
                weights=one[None],
                persistences=one[None],
                gains=jnp.ones(len(self.ladder.octaves)),
                mask_gain=none,
                threshold=none,
                barrier_strength=one,
                base_m=none,
                top_m=one,
                barrier_scale_m=one,
                smoothing=none,
            ),
            latent=self.latent,
            shell=self.shell,
            ladders=(self.ladder,),
            seed=self.seed,
            thickness_m=self.thickness_m,
        )
