"""What a fit makes small: differences of cumulative histograms, band by band.

Of the residuals tried, differences of cumulative histograms alone let
Levenberg-Marquardt find the parameters from every start (docs/decisions.md).
"""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from cloudjax import BandRadiances, Scene, View, radiances, sample
from cloudjax.weather import LatLonGrid
from jaxtyping import Array, Float, Int, PyTree

from .histogram import Bins, cumulative, linear_histogram
from .model import look
from .parameters import Parameter, put_all, values_of
from .selection import CloudRule
from .target import Target, block_of_pixels


# A residual of 1 is a difference of 1/SCALE between the cumulative histograms: what a
# thousand independent pixels leave undecided, and the weight of one standard deviation
# of a prior.
SCALE = 30.0
# The covered share of the whole sky is one number beside the bins of a histogram.
COVERAGE_SCALE = 4 * SCALE
# By how much another draw of the same clouds changes the covered share of one block of
# the image. A histogram does not see where clouds are; this keeps them in their place.
BLOCK_SPREAD = 0.15


class Problem(eqx.Module):
    """Everything that stays as it is during a fit.

    The textures have been sampled: eq. (1) is linear in the samples, and no parameter
    that is fitted moves one.

    **Fields:**

    - `scene`: at the parameters' defaults.
    - `samples`, `view`, `background`: of the rays.
    - `bins`, `observed`: of each band, reflective ones first: [bands] and [bands bins].
    - `sky_share`: of the pixels that the rays stand for: no cloud reaches the others.
    - `cloud_fraction`: observed, of the whole sky.
    - `block_of_ray`, `block_weight`, `block_fraction`: the block of the image that each
      ray is in; to turn the sum over a block's rays into its cloud fraction; and that
      fraction as observed.
    - `parameters`, `rule`: static.
    """

    scene: Scene
    view: View
    samples: tuple[PyTree, ...]
    background: BandRadiances
    bins: Bins
    observed: Float[Array, "bands bins"]
    sky_share: Float[Array, ""]
    cloud_fraction: Float[Array, ""]
    block_of_ray: Int[Array, " rays"]
    block_weight: Float[Array, " blocks"]
    block_fraction: Float[Array, " blocks"]
    parameters: tuple[Parameter, ...] = eqx.field(static=True)
    rule: CloudRule = eqx.field(static=True)

    @property
    def bands(self) -> tuple[int, ...]:
        groups = (self.scene.reflective, self.scene.emissive)
        return tuple(n for group in groups if group is not None for n in group.numbers)


def simulate(
    problem: Problem, values: Float[Array, " parameters"]
) -> tuple[Float[Array, "bands rays"], Float[Array, " rays"]]:
    """Radiances of the rays and the share of each that is selected as cloud."""
    scene = put_all(problem.scene, problem.parameters, values)
    seen = radiances(scene, problem.view, problem.samples, problem.background)
    weights = problem.rule.weights(seen, scene.reflective, scene.emissive)
    return stacked(seen), weights


def stacked(seen: BandRadiances) -> Float[Array, "bands rays"]:
    """All bands in one array, the reflective ones first."""
    return jnp.concatenate(jax.tree.leaves(seen))


def residuals(
    z: Float[Array, " parameters"], problem: Problem
) -> Float[Array, " residuals"]:
    """Of the histograms band by band, of the coverage, and of the priors."""
    values = values_of(problem.parameters, z)
    seen, weights = simulate(problem, values)
    histogram = jax.vmap(linear_histogram, (0, None, 0))(seen, weights, problem.bins)
    shape = SCALE * (jax.vmap(cumulative)(histogram) - problem.observed)
    surprise = [p.surprise(values[i]) for i, p in enumerate(problem.parameters)]
    return jnp.concatenate(
        [shape.reshape(-1), _coverage(weights, problem), jnp.stack(surprise)]
    )


def _coverage(weights, problem: Problem) -> Float[Array, " blocks_and_one"]:
    whole = weights.mean() * problem.sky_share - problem.cloud_fraction
    empty = jnp.zeros_like(problem.block_fraction)
    blocks = empty.at[problem.block_of_ray].add(weights) * problem.block_weight
    blocks = (blocks - problem.block_fraction) / BLOCK_SPREAD
    return jnp.concatenate([COVERAGE_SCALE * whole[None], blocks])


def pose(
    target: Target,
    scene: Scene,
    parameters: Sequence[Parameter],
    *,
    rays: int,
    seed: int,
    resolution: int = 128,
) -> tuple[Problem, Int[np.ndarray, " rays"]]:
    """Choose rays, navigate them and sample the textures along them.

    Rays are drawn from the pixels that any class of cloud may reach.

    **Returns:** the problem and the pixels that its rays belong to.
    """
    pixels, share = _draw_pixels(target, rays, seed)
    every = target.grid.rays()
    view, background = look(scene, target, every[pixels])
    textures = make_textures(scene, target, resolution)
    samples = eqx.filter_jit(sample)(scene, view, textures)
    block, weight = _blocks(target, pixels, share)
    bands = [*target.reflective, *target.emissive]
    bins = Bins(
        jnp.asarray([b.low for b in bands]),
        jnp.asarray([b.high for b in bands]),
        bands[0].block_counts.shape[1],
    )
    counts = np.stack([b.block_counts.sum(0) for b in bands])
    observed = np.cumsum(counts, axis=1) / counts.sum(axis=1, keepdims=True)
    problem = Problem(
        scene=scene,
        view=view,
        samples=samples,
        background=background,
        bins=bins,
        observed=jnp.asarray(observed, float),
        sky_share=jnp.asarray(share, float),
        cloud_fraction=jnp.asarray(target.cloud_fraction, float),
        block_of_ray=jnp.asarray(block),
        block_weight=jnp.asarray(weight, float),
        block_fraction=jnp.asarray(
            target.block_cloud / np.maximum(target.block_valid, 1), float
        ),
        parameters=tuple(parameters),
        rule=target.rule,
    )
    return problem, pixels


def make_textures(scene: Scene, target: Target, resolution: int = 128) -> tuple:
    """Each layer's textures, averaged over the target's median pixel."""
    footprint = float(np.nanmedian(target.grid.rays().footprint_m()))
    return tuple(
        layer.cloud.make_textures(footprint, resolution) for layer in scene.layers
    )


def _blocks(target: Target, pixels, share: float):
    """Block of each ray, and what turns a sum over its rays into a cloud fraction."""
    block = block_of_pixels(target.grid.shape, target.blocks)[pixels]
    # Every ray stands for the same number of pixels.
    pixels_per_ray = share * target.block_valid.sum() / len(pixels)
    return block, pixels_per_ray / np.maximum(target.block_valid, 1)


# Where all classes together cover less of the sky than this, no ray is spent.
_LEAST_FRACTION = 0.005


def _draw_pixels(target: Target, count: int, seed: int):
    """Pixels to simulate, and the share of the Earth's pixels that they stand for."""
    ground, hit = target.grid.rays().ground(target.grid.ellipsoid)
    grid = LatLonGrid.from_axes(target.latitude_deg, target.longitude_deg)
    cover = np.maximum.reduce(list(target.fractions.values()))[..., None]
    reach = grid.sample(cover, ground.latitude_deg, ground.longitude_deg)[..., 0]
    candidates = np.flatnonzero(hit & (np.asarray(reach) > _LEAST_FRACTION))
    chosen = np.random.default_rng(seed).permutation(candidates)[:count]
    return np.sort(chosen), len(candidates) / hit.sum()
