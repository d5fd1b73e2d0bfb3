"""Fractal clouds: the soft level set of the cloud function in its shell."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from cloudjax.geometry.footprint import Footprint, Sampling
from cloudjax.geometry.geodesy import geodetic, vertical
from cloudjax.geometry.path import (
    Path,
    Profile,
    device_array,
    middles,
    navigate,
    points_along,
    to_points,
)
from cloudjax.geometry.rays import Rays
from cloudjax.geometry.shells import Chords, Shell
from cloudjax.weather.advection import DisplacementMap
from cloudjax.weather.drift import drift_m, strain
from cloudjax.weather.masks import AbstractMask

from .cloud_function import CloudFunction
from .fractal_path import FractalPath
from .source import AbstractCloudSource, Occupancy, Slopes
from .texture import Fractal, Texture, Unresolved, make_texture


# Beyond this many widths the level set is decided: erf is 1 to float32.
_MAX_WIDTHS = 8.0
# A change of CF within one step that is as good as a jump.
_MAX_CHANGE = 6.0
# Steps to each point at which gradients of textures are sampled.
_STEPS_PER_SLOPE = 3
# Sub-pixel structure is taken for common over this part of a cloud's thickness, along
# the ray: measured against many hard rays per pixel (docs/decisions.md).
_COMMON_WAY = 0.35


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


class FractalSamples(eqx.Module):
    """All that eq. (1) needs along the rays and that no fitted parameter moves.

    CF is linear in these, so a fit samples once and works on them. What changes within
    many steps only is held at few points.

    **Fields:**

    - `path`: the geometry.
    - `mask`: weather mask w.
    - `texture_values`, `unresolved`: of each texture.
    - `up`, `texture_gradients`: the vertical, and gradients per metre, at points in the
      middle of equal parts of the chord; None where no slopes are asked.
    - `steps`: of the march that they were made for.
    """

    path: Path
    mask: Profile
    texture_values: tuple[Profile, ...]
    unresolved: tuple[Unresolved, ...]
    up: Float[Array, "rays 3 points"] | None
    texture_gradients: tuple[Float[Array, "rays 3 points"], ...] | None
    steps: int = eqx.field(static=True)

    def on(self, path: Path, at: Float[Array, "rays points"]) -> "FractalSamples":
        """Read them at parts of the chord, 0 to 1, as if at another path's steps."""
        # From the steps, for there they are the same however they are held.
        marched = [Profile(v.in_steps(self.steps)) for v in self.texture_values]
        return FractalSamples(
            path=path,
            mask=Profile(self.mask.at(at)),
            texture_values=tuple(Profile(v.at(at)) for v in marched),
            unresolved=self.unresolved,
            up=None,
            texture_gradients=None,
            steps=at.shape[-1],
        )


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
    - `mask`: where the weather lets the clouds stand; None is w = 0 everywhere.
    - `displacements`: of each texture, the map by which the wind has drawn it; None for
      still air.

    The mask and the maps are read once, when a view is made; the other arrays are
    parameters.
    """

    function: CloudFunction
    latent: Latent
    shell: Shell = eqx.field(static=True)
    fractals: tuple[Fractal, ...] = eqx.field(static=True)
    length_scales_m: tuple[float, ...] = eqx.field(static=True)
    seed: int = eqx.field(static=True, default=0)
    thickness_m: float = eqx.field(static=True, default=1500.0)
    mask: AbstractMask | None = None
    displacements: tuple[DisplacementMap | None, ...] | None = None

    def __check_init__(self):
        counts = {
            len(self.fractals),
            len(self.length_scales_m),
            self.function.weights.shape[0],
        }
        if self.displacements is not None:
            counts.add(len(self.displacements))
        if len(counts) != 1:
            raise ValueError(
                f"{len(self.fractals)} fractals, {len(self.length_scales_m)} length "
                f"scales and {self.function.weights.shape[0]} weights: give one of "
                "each per texture, and a displacement map where there are any."
            )

    def make_textures(
        self, footprint: Footprint, resolution: int = 128
    ) -> tuple[Texture, ...]:
        """Make the cloud's textures, averaged over one kind of pixel."""
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

    def navigate(self, rays: Rays, chord: Chords, sampling: Sampling) -> FractalPath:
        """Lay rays along chords of the shell, on the host in float64."""
        points = points_along(rays, chord, sampling.knots)
        periods = np.asarray(self.length_scales_m)[:, None]
        entry = points[0][:, None] / periods
        change = np.stack([point - points[0] for point in points[1:]], axis=-1)
        masks = np.stack([_mask_at(self.mask, p) for p in points], axis=-1)
        mask = Profile(device_array(masks), ends=True)
        short = sampling.knots == 2
        way = FractalPath(
            path=navigate(rays, chord),
            mask=mask.with_knots(sampling.held_knots),
            texture_entry=device_array(entry % 1.0),
            texture_change=device_array(change[:, None] / periods[..., None]),
            strain=None,
            reads=_reads(self.shell, sampling.footprint) if short else None,
            at_steps=sampling.at_steps,
        )
        maps = self.displacements
        if maps is None or all(m is None for m in maps):
            return way
        upward, altitude = vertical(np.stack(points, axis=-2))
        return _drifted(
            way,
            device_array(upward),
            device_array(altitude),
            *_distinct(maps),
            device_array(periods[:, 0]),
        )

    def likelihood(
        self, samples: FractalPath | FractalSamples
    ) -> Float[Array, " rays"]:
        """Estimate how likely a ray is to meet cloud, by the most of its mask."""
        most = self.function.likelihood(samples.mask.values.max(-1))
        return jnp.where(samples.path.length_m > 0, most, 0.0)

    def sample(
        self,
        way: FractalPath,
        textures: tuple[Texture, ...],
        *,
        steps: int,
        slopes: bool,
    ) -> FractalSamples:
        """Read the textures along the ways, as often as they can change."""
        reads = way.reads if way.reads is not None and way.reads <= steps else None
        at = middles(steps) if reads is None else np.linspace(0, 1, reads)
        points = _slope_points(steps, reads)
        values, gradients, unresolved = [], [], []
        for i, texture in enumerate(textures):
            read = Profile(texture.sample(way.position(i, at)), ends=reads is not None)
            values.append(Profile(read.in_steps(steps)) if way.at_steps else read)
            lost = texture.unresolved
            if slopes:
                gradient, stretch = self._gradient(way, texture, i, points)
                gradients.append(_held(gradient, steps, way.at_steps))
                lost = eqx.tree_at(lambda u: u.slope, lost, lost.slope * stretch)
            unresolved.append(_for_each_ray(lost, way))
        up = way.path.up(way.path.distance_m(points)) if slopes else None
        return FractalSamples(
            path=way.path,
            mask=way.mask,
            texture_values=tuple(values),
            unresolved=tuple(unresolved),
            up=None if up is None else _held(up, steps, way.at_steps),
            texture_gradients=tuple(gradients) if slopes else None,
            steps=steps,
        )

    def _gradient(self, way: FractalPath, texture: Texture, i: int, points: int):
        """Per metre, [3 rays points], and by how much wind has stretched its square."""
        _, gradient = texture.sample_with_gradient(way.position(i, middles(points)))
        gradient = gradient / self.length_scales_m[i]
        if way.strain is None:
            return gradient, 1.0
        strained = jnp.einsum("rka,krs->ars", way.strain[:, i], gradient)
        return strained, jnp.sum(way.strain[:, i] ** 2, axis=(1, 2)) / 3

    def branch(
        self,
        way: FractalPath,
        distance_m: Float[Array, " rays"],
        direction: Float[Array, "rays 3"],
        ends_m: Float[Array, "rays ends"],
    ) -> FractalPath:
        """Leave the ways in another direction, with the mask where they are left."""
        periods = jnp.asarray(self.length_scales_m, float)
        return way.branch(distance_m, direction, ends_m, periods)

    def occupancy(self, samples: FractalSamples, steps: int) -> Occupancy:
        """Find the soft level set: the share of cloud in each step, for each node."""
        f = self.function
        altitude = samples.path.altitude_m(samples.path.distance_m(steps))
        read = samples.texture_values
        # Summed up where they were read, which is less work than at the steps.
        fractal = Profile(f.fractal(tuple(v.values for v in read)), read[0].ends)
        mask = samples.mask.in_steps(steps)
        value = f(fractal.in_steps(steps), mask, altitude)
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
        # jax.scipy's ndtr keeps the far tails to all digits, at three times the price.
        fraction = 0.5 + 0.5 * jax.lax.erf(np.sqrt(0.5) * widths)
        slopes = None
        if samples.texture_gradients is not None and samples.up is not None:
            first = [jnp.moveaxis(g, 1, 0) for g in samples.texture_gradients]
            slopes = Slopes(
                f.gradient(tuple(first)),
                f.rise(altitude),
                jnp.moveaxis(samples.up, 1, 0),
                sum((u.slope for u in lost), none),
            )
        return Occupancy(fraction, self.latent.weights, slopes)


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


def _held(
    at_points: Float[Array, "3 rays points"], steps: int, at_steps: bool
) -> Float[Array, "rays 3 held"]:
    """Rays first; at every step where that is asked, linear between points."""
    held = jnp.moveaxis(at_points, 0, 1)
    points = held.shape[-1]
    if not at_steps or points == steps:
        return held
    share = jnp.asarray(to_points(steps, points).T, held.dtype)
    return jnp.matmul(held, share, precision="highest")


def _for_each_ray(lost: Unresolved, way: FractalPath) -> Unresolved:
    rays = way.path.length_m.shape
    return jax.tree.map(lambda v: jnp.broadcast_to(v, rays), lost)


def _slope_points(steps: int, reads: int | None) -> int:
    points = min(steps, max(3, -(-steps // _STEPS_PER_SLOPE)))
    return points if reads is None else min(points, max(1, reads // 2))


def _reads(shell: Shell, footprint: Footprint) -> int | None:
    """How often a texture is worth reading on a short way through a shell."""
    if footprint.spacing_m == 0:
        return None
    depth = shell.top_m - shell.bottom_m
    return 1 + math.ceil(depth / footprint.spacing_m)


def _mask_at(mask, position_m) -> Float[np.ndarray, " rays"]:
    if mask is None:
        return np.zeros(len(position_m))
    latitude_deg, longitude_deg, _ = geodetic(position_m)
    return np.asarray(mask(latitude_deg, longitude_deg))


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
        reads=way.reads,
        at_steps=way.at_steps,
    )
