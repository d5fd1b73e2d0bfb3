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
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import ndtr
from jaxtyping import Array, Float

from .footprint import POINT, Footprint
from .geodesy import geodetic, up
from .path import (
    Path,
    along_chord,
    device_array,
    drift_m,
    navigate,
    points_along,
    strain,
)
from .rays import Rays
from .shell import Chords, Shell
from .source import AbstractCloudSource, Occupancy
from .texture import Fractal, Texture, Unresolved, make_texture


# Past this many e-folds a barrier is shut; unclipped, exp overflows float32 at 88 and
# turns gradients into NaN.
_MAX_EFOLDS = 30.0
# Beyond this many widths the level set is decided: ndtr is 0 or 1 to float32.
_MAX_WIDTHS = 8.0
# A change of CF within one step that is as good as a jump.
_MAX_CHANGE = 6.0
# Sub-pixel structure is taken for common over this part of a cloud's thickness, along
# the ray: measured against many hard rays per pixel (docs/decisions.md).
_COMMON_WAY = 0.35


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

    Averaging the textures over the footprint removes variance from CF. The part that
    all points of a ray within the cloud have in common enters as a Gaussian latent,
    radiances being averaged over its Gauss-Hermite nodes; the rest widens the level
    set.

    **Fields:** `nodes`, `weights` of the quadrature.
    """

    nodes: Float[Array, " nodes"]
    weights: Float[Array, " nodes"]

    @staticmethod
    def gauss_hermite(count: int = 5) -> "Latent":
        nodes, weights = np.polynomial.hermite_e.hermegauss(count)
        return Latent(
            jnp.asarray(nodes, float), jnp.asarray(weights / weights.sum(), float)
        )


class FractalPath(eqx.Module):
    """A ray's way through a fractal shell.

    Masks and winds are found at the knots, equally far apart from the entry to the
    exit, and are linear in between.

    **Fields:**

    - `path`: the geometry.
    - `mask`: weather mask w at the knots.
    - `texture_entry`: upwind position of the entry in periods, reduced to [0, 1).
    - `texture_change`: from the entry to each further knot, in periods.
    - `strain`: ∂x'/∂x of each texture's displacement, None without wind.
    """

    path: Path
    mask: Float[Array, "rays knots"]
    texture_entry: Float[Array, "rays textures 3"]
    texture_change: Float[Array, "rays textures 3 knots-1"]
    strain: Float[Array, "rays textures 3 3"] | None


class FractalSamples(eqx.Module):
    """All that eq. (1) needs along the rays and that no fitted parameter moves.

    CF is linear in these, so a fit samples once and works on them.
    """

    distance_m: Float[Array, "rays steps"]
    altitude_m: Float[Array, "rays steps"]
    mask: Float[Array, "rays steps"]
    texture_values: tuple[Float[Array, "rays steps"], ...]
    unresolved: tuple[Unresolved, ...]
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
    - `thickness_m`: a usual one of the cloud. Sub-pixel structure is common to rays
      over a part of it.
    """

    function: CloudFunction
    latent: Latent
    shell: Shell = eqx.field(static=True)
    fractals: tuple[Fractal, ...] = eqx.field(static=True)
    length_scales_m: tuple[float, ...] = eqx.field(static=True)
    seed: int = eqx.field(static=True, default=0)
    thickness_m: float = eqx.field(static=True, default=1500.0)

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
        self, footprint: Footprint = POINT, resolution: int = 128
    ) -> tuple[Texture, ...]:
        """The cloud's textures, averaged over a kind of pixel."""
        return tuple(
            make_texture(
                fractal,
                self.seed + i,
                resolution,
                length_scale_m=scale,
                footprint=footprint,
                way_m=_COMMON_WAY * self.thickness_m / footprint.slant,
            )
            for i, (fractal, scale) in enumerate(
                zip(self.fractals, self.length_scales_m, strict=True)
            )
        )

    def navigate(
        self,
        rays: Rays,
        chord: Chords,
        mask=None,
        displacements=None,
        *,
        knots: int = 2,
    ) -> FractalPath:
        """Ways of rays along chords of the shell, on the host in float64."""
        points = points_along(rays, chord, knots)
        places = [geodetic(point) for point in points]
        periods = np.asarray(self.length_scales_m)[:, None]
        entry = points[0][:, None] / periods
        change = np.stack([point - points[0] for point in points[1:]], axis=-1)
        way = FractalPath(
            path=navigate(rays, chord),
            mask=jnp.stack([_mask_at(mask, *place) for place in places], axis=-1),
            texture_entry=device_array(entry % 1.0),
            texture_change=device_array(change[:, None] / periods[..., None]),
            strain=None,
        )
        maps = displacements
        if not isinstance(maps, Sequence):
            maps = [displacements] * len(self.length_scales_m)
        if all(m is None for m in maps):
            return way
        vertical = np.stack([up(φ, λ) for φ, λ, _ in places], axis=-2)
        altitude = np.stack([z for _, _, z in places], axis=-1)
        return _drifted(
            way,
            device_array(vertical),
            device_array(altitude),
            *_distinct(maps),
            device_array(periods[:, 0]),
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
        mask = along_chord(way.mask.T[..., None], steps)
        values, gradients, unresolved = [], [], []
        for i, texture in enumerate(textures):
            entry, change = way.texture_entry[:, i].T, way.texture_change[:, i]
            ways = [
                jnp.zeros((3, 1, 1)),
                *jnp.moveaxis(change, (2, 1), (0, 1))[..., None],
            ]
            u = entry[..., None] + along_chord(ways, steps)
            lost = texture.unresolved
            if with_gradient:
                value, gradient = texture.sample_with_gradient(u)
                gradient = gradient / self.length_scales_m[i]
                if way.strain is not None:
                    gradient = jnp.einsum("rka,krs->ars", way.strain[:, i], gradient)
                    stretch = jnp.sum(way.strain[:, i] ** 2, axis=(1, 2)) / 3
                    lost = eqx.tree_at(lambda u: u.slope, lost, lost.slope * stretch)
                gradients.append(gradient)
            else:
                value = texture.sample(u)
            values.append(value)
            rays = distance.shape[0]
            unresolved.append(
                jax.tree.map(lambda v, rays=rays: jnp.broadcast_to(v, (rays,)), lost)
            )
        return FractalSamples(
            distance_m=distance,
            altitude_m=way.path.altitude_m(distance),
            mask=mask,
            texture_values=tuple(values),
            unresolved=tuple(unresolved),
            up=way.path.up(distance) if with_gradient else None,
            texture_gradients=tuple(gradients) if with_gradient else None,
        )

    def occupancy(self, samples: FractalSamples) -> Occupancy:
        """The soft level set: how much of each step is cloud, for each latent node."""
        f = self.function
        value = f(samples.texture_values, samples.mask, samples.altitude_m)
        lost = [
            jax.tree.map(lambda v, m=f.weights[i]: m**2 * v, unresolved)
            for i, unresolved in enumerate(samples.unresolved)
        ]
        none = jnp.zeros(value.shape[0])
        common = sum((u.common for u in lost), none)
        own = sum((u.own for u in lost), none)
        if self.latent.nodes.shape[0] == 1:
            common, own = none, own + common
        # The floors keep the slopes of the roots finite where nothing is lost.
        left = (f.smoothing**2 + own)[:, None] + _spread_of_steps(value)
        width = jnp.sqrt(jnp.maximum(left, 1e-12))
        shift = jnp.sqrt(jnp.maximum(common, 1e-12))[:, None]
        shifted = value[None] + self.latent.nodes[:, None, None] * shift[None]
        widths = jnp.clip(shifted / width[None], -_MAX_WIDTHS, _MAX_WIDTHS)
        gradient = None
        if samples.texture_gradients is not None and samples.up is not None:
            gradient = f.gradient(
                samples.texture_gradients, samples.altitude_m, samples.up
            )
        slope = sum((u.slope for u in lost), none)
        return Occupancy(ndtr(widths), self.latent.weights, gradient, slope)


def _spread_of_steps(value: Float[Array, "rays steps"]) -> Float[Array, "rays steps"]:
    """Variance of CF within each step, as of a straight line: (change)²/12.

    It makes the share of a step that is cloud right where the level set cuts it, so
    that the march converges with the square of the step.
    """
    if value.shape[-1] == 1:
        return jnp.zeros_like(value)
    change = jnp.diff(value, axis=-1)
    inner = (change[:, 1:] + change[:, :-1]) / 2
    whole = jnp.concatenate([change[:, :1], inner, change[:, -1:]], axis=-1)
    # Where a barrier shuts within one step, no width can say where.
    return jnp.minimum(jnp.abs(whole), _MAX_CHANGE) ** 2 / 12


def _mask_at(mask, latitude_deg, longitude_deg, _) -> Float[Array, " rays"]:
    if mask is None:
        return jnp.zeros(len(latitude_deg))
    return device_array(mask(latitude_deg, longitude_deg))


def _distinct(maps) -> tuple[tuple, tuple[int, ...]]:
    """The maps, each once, and which one each texture has: textures may share one."""
    once = {id(m): m for m in maps}
    order = list(once)
    return tuple(once.values()), tuple(order.index(id(m)) for m in maps)


@eqx.filter_jit
def _drifted(
    way: FractalPath,
    vertical: Float[Array, "rays knots 3"],
    altitude_m: Float[Array, "rays knots"],
    maps: tuple,
    map_of: tuple[int, ...],
    periods_m: Float[Array, " textures"],
) -> FractalPath:
    """A way whose air came from elsewhere, by the displacement map of each texture."""
    drifts = [
        0 * vertical if m is None else drift_m(vertical, altitude_m, m) for m in maps
    ]
    calm = jnp.broadcast_to(jnp.eye(3), (len(vertical), 3, 3))
    strains = [calm if m is None else strain(vertical[:, 0], m) for m in maps]
    scale = periods_m[None, :, None, None]
    drift = jnp.stack([drifts[i] for i in map_of], axis=1) / scale
    start, further = drift[:, :, 0], drift[:, :, 1:] - drift[:, :, :1]
    return FractalPath(
        path=way.path,
        mask=way.mask,
        texture_entry=(way.texture_entry + start) % 1.0,
        texture_change=way.texture_change + jnp.moveaxis(further, 2, 3),
        strain=jnp.stack([strains[i] for i in map_of], axis=1),
    )
