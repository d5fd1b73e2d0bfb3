"""Fractal clouds: the cloud function and its soft level set.

Schinder et al. 2024, eq. (1), with standardised textures (their offsets b_i fold into
the threshold T):

    CF(x) = Σ m_i F_i(x'/LS_i) + g w(x) - a exp(-(z - z_b)/h) - a exp((z - z_t)/h) - T

Multiplying m, g, a and T by one number moves no cloud. That gauge is fixed by holding
the first weight at 1; and since a and h move the barriers as z_b and z_t do, a is held
as well.
"""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import ndtr
from jaxtyping import Array, Float

from .geodesy import geodetic
from .path import Path, device_array, navigate, upwind
from .rays import Rays
from .shell import Shell, chords
from .source import AbstractCloudSource, Occupancy
from .texture import Fractal, Texture, make_texture


# Past this many e-folds a barrier is shut; unclipped, exp overflows float32 at 88 and
# turns gradients into NaN.
_MAX_EFOLDS = 30.0
# Beyond this many widths the level set is decided: ndtr is 0 or 1 to float32.
_MAX_WIDTHS = 8.0


class CloudFunction(eqx.Module):
    """The parameters of eq. (1).

    **Fields:**

    - `weights`: m_i, one per texture, in units of CF; the first is held at 1.
    - `mask_gain`: g, of the weather mask.
    - `threshold`: T.
    - `barrier_strength`: a, held at 1.
    - `base_m`, `top_m`: altitudes z_b and z_t of the condensation barriers.
    - `barrier_scale_m`: h.
    - `smoothing`: s₀, width of the level set that remains without any footprint.
    """

    weights: Float[Array, " textures"]
    mask_gain: Float[Array, ""]
    threshold: Float[Array, ""]
    barrier_strength: Float[Array, ""]
    base_m: Float[Array, ""]
    top_m: Float[Array, ""]
    barrier_scale_m: Float[Array, ""]
    smoothing: Float[Array, ""]

    def __call__(
        self,
        texture_values: tuple[Float[Array, "rays steps"], ...],
        mask: Float[Array, "rays steps"],
        altitude_m: Float[Array, "rays steps"],
    ) -> Float[Array, "rays steps"]:
        """CF in the cloud where positive."""
        below, above = self._barriers(altitude_m)
        value = self.mask_gain * mask - below - above - self.threshold
        # An explicit sum: a product with a weight vector, reduced, is miscompiled by
        # one release of jax (docs/decisions.md).
        for i, texture in enumerate(texture_values):
            value = value + self.weights[i] * texture
        return value

    def gradient(
        self,
        texture_gradients: tuple[Float[Array, "3 rays steps"], ...],
        altitude_m: Float[Array, "rays steps"],
        up: Float[Array, "3 rays steps"],
    ) -> Float[Array, "3 rays steps"]:
        """∇CF per metre. The mask varies over tens of kilometres: left out."""
        below, above = self._barriers(altitude_m)
        value = ((below - above) / self.barrier_scale_m)[None] * up
        for i, texture in enumerate(texture_gradients):
            value = value + self.weights[i] * texture
        return value

    def _barriers(self, altitude_m):
        below = (self.base_m - altitude_m) / self.barrier_scale_m
        above = (altitude_m - self.top_m) / self.barrier_scale_m
        return (
            self.barrier_strength * jnp.exp(jnp.minimum(below, _MAX_EFOLDS)),
            self.barrier_strength * jnp.exp(jnp.minimum(above, _MAX_EFOLDS)),
        )


class Latent(eqx.Module):
    """What a pixel does not resolve: one standard Gaussian per ray, by quadrature.

    Averaging the textures over the footprint removes the variance Σ m_i² v_i from CF.
    A share of it is common to the whole ray and enters as a Gaussian latent, radiances
    being averaged over its Gauss-Hermite nodes; the rest widens the level set.

    **Fields:** `nodes`, `weights` of the quadrature, `share` of the variance.
    """

    nodes: Float[Array, " nodes"]
    weights: Float[Array, " nodes"]
    share: Float[Array, ""]

    @staticmethod
    def gauss_hermite(count: int = 3, share: float = 0.8) -> "Latent":
        nodes, weights = np.polynomial.hermite_e.hermegauss(count)
        return Latent(
            jnp.asarray(nodes, float),
            jnp.asarray(weights / weights.sum(), float),
            jnp.asarray(share if count > 1 else 0.0, float),
        )


class FractalPath(eqx.Module):
    """A ray's way through a fractal shell.

    **Fields:**

    - `path`: the geometry.
    - `mask_entry`, `mask_exit`: weather mask w at both ends of the chord.
    - `texture_entry`: upwind position of the entry in periods, reduced to [0, 1).
    - `texture_change`: from the entry to the exit, in periods.
    - `strain`: ∂x'/∂x of each texture's displacement, None without wind.
    """

    path: Path
    mask_entry: Float[Array, " rays"]
    mask_exit: Float[Array, " rays"]
    texture_entry: Float[Array, "rays textures 3"]
    texture_change: Float[Array, "rays textures 3"]
    strain: Float[Array, "rays textures 3 3"] | None


class FractalSamples(eqx.Module):
    """All that eq. (1) needs along the rays and that no fitted parameter moves.

    CF is linear in these, so a fit samples once and works on them.
    """

    distance_m: Float[Array, "rays steps"]
    altitude_m: Float[Array, "rays steps"]
    mask: Float[Array, "rays steps"]
    texture_values: tuple[Float[Array, "rays steps"], ...]
    lost_variances: tuple[Float[Array, ""], ...]
    up: Float[Array, "3 rays steps"] | None
    texture_gradients: tuple[Float[Array, "3 rays steps"], ...] | None


class FractalCloud(AbstractCloudSource):
    """A class of fractal clouds in its shell.

    **Fields:**

    - `function`: the parameters of eq. (1).
    - `latent`: the quadrature over sub-pixel structure.
    - `shell`: the air that is marched.
    - `fractals`, `length_scales_m`: the textures and their periods LS_i.
    - `seed`: of the first texture; the others follow.
    """

    function: CloudFunction
    latent: Latent
    shell: Shell = eqx.field(static=True)
    fractals: tuple[Fractal, ...] = eqx.field(static=True)
    length_scales_m: tuple[float, ...] = eqx.field(static=True)
    seed: int = eqx.field(static=True, default=0)

    def __check_init__(self):
        counts = {
            len(self.fractals),
            len(self.length_scales_m),
            self.function.weights.shape[0],
        }
        if len(counts) != 1:
            raise ValueError(
                f"{len(self.fractals)} fractals, {len(self.length_scales_m)} length "
                f"scales and {self.function.weights.shape[0]} weights: give one of "
                "each per texture."
            )

    def make_textures(
        self, footprint_m: float, resolution: int = 128
    ) -> tuple[Texture, ...]:
        """The cloud's textures, averaged over pixels of a width on the ground."""
        return tuple(
            make_texture(fractal, self.seed + i, resolution, footprint_m / scale)
            for i, (fractal, scale) in enumerate(
                zip(self.fractals, self.length_scales_m, strict=True)
            )
        )

    def navigate(self, rays: Rays, mask=None, displacements=None) -> FractalPath:
        """Ways of rays through the shell, on the host in float64."""
        chord = chords(rays, self.shell)
        entry = rays.at(chord.entry_m)
        leave = rays.at(chord.entry_m + chord.length_m)
        periods = np.asarray(self.length_scales_m)
        maps = displacements
        if not isinstance(maps, Sequence):
            maps = [displacements] * len(periods)
        sources = np.stack([_source(entry, m) for m in maps], axis=1)
        sinks = np.stack([_source(leave, m) for m in maps], axis=1)
        strain = None
        if displacements is not None:
            strain = np.stack([_strain(entry, m) for m in maps], axis=1)
        return FractalPath(
            path=navigate(rays, chord),
            mask_entry=_mask_at(mask, entry),
            mask_exit=_mask_at(mask, leave),
            texture_entry=device_array((sources / periods[:, None]) % 1.0),
            texture_change=device_array((sinks - sources) / periods[:, None]),
            strain=None if strain is None else device_array(strain),
        )

    def sample(
        self,
        way: FractalPath,
        textures: tuple[Texture, ...],
        *,
        steps: int,
        with_gradient: bool,
    ) -> FractalSamples:
        distance = way.path.distance_m(steps)
        along = (jnp.arange(steps, dtype=distance.dtype) + 0.5) / steps
        mask = (
            way.mask_entry[:, None]
            + along[None, :] * ((way.mask_exit - way.mask_entry)[:, None])
        )
        values, gradients = [], []
        for i, texture in enumerate(textures):
            entry, change = way.texture_entry[:, i].T, way.texture_change[:, i].T
            u = entry[..., None] + change[..., None] * along[None, None, :]
            if with_gradient:
                value, gradient = texture.sample_with_gradient(u)
                gradient = gradient / self.length_scales_m[i]
                if way.strain is not None:
                    gradient = jnp.einsum("rka,krs->ars", way.strain[:, i], gradient)
                gradients.append(gradient)
            else:
                value = texture.sample(u)
            values.append(value)
        return FractalSamples(
            distance_m=distance,
            altitude_m=way.path.altitude_m(distance),
            mask=mask,
            texture_values=tuple(values),
            lost_variances=tuple(t.lost_variance for t in textures),
            up=way.path.up(distance) if with_gradient else None,
            texture_gradients=tuple(gradients) if with_gradient else None,
        )

    def occupancy(self, samples: FractalSamples) -> Occupancy:
        """The soft level set: how much of each step is cloud, for each latent node."""
        f = self.function
        value = f(samples.texture_values, samples.mask, samples.altitude_m)
        lost = sum(f.weights[i] ** 2 * v for i, v in enumerate(samples.lost_variances))
        # The floors keep the slopes of the roots finite where nothing is lost.
        left = f.smoothing**2 + (1 - self.latent.share) * lost
        width = jnp.sqrt(jnp.maximum(left, 1e-12))
        shift = jnp.sqrt(jnp.maximum(self.latent.share * lost, 1e-12))
        shifted = value[None] + (self.latent.nodes * shift)[:, None, None]
        widths = jnp.clip(shifted / width, -_MAX_WIDTHS, _MAX_WIDTHS)
        gradient = None
        if samples.texture_gradients is not None and samples.up is not None:
            gradient = f.gradient(
                samples.texture_gradients, samples.altitude_m, samples.up
            )
        return Occupancy(ndtr(widths), self.latent.weights, gradient)


def _mask_at(mask, position_m) -> Float[Array, " rays"]:
    if mask is None:
        return jnp.zeros(len(position_m))
    latitude, longitude, _ = geodetic(position_m)
    return device_array(mask(latitude, longitude))


def _source(position_m, displacement):
    return position_m if displacement is None else upwind(position_m, displacement)


def _strain(position_m, displacement, step_m=2e3):
    """∂x'/∂x by central differences over a few kilometres, [rays 3 3]."""
    if displacement is None:
        return np.broadcast_to(np.eye(3), (len(position_m), 3, 3))
    columns = [
        upwind(position_m + step, displacement)
        - upwind(position_m - step, displacement)
        for step in step_m * np.eye(3)
    ]
    return np.stack(columns, axis=-1) / (2 * step_m)
