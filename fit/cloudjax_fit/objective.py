"""What a fit makes small: differences of cumulative histograms, band by band.

Of the residuals tried, differences of cumulative histograms alone let
Levenberg-Marquardt find the parameters from every start (docs/decisions.md).
"""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from cloudjax import FractalCloud, Scene, View, look, radiances
from cloudjax_data import sun_direction
from cloudjax_scenes.cloud_rule import CloudRule

from .histogram import Bins, cumulative, spline_histogram
from .parameters import Parameter, put_all, values_of
from .targets import Target, block_of_pixels


# A residual of 1 is a difference of 1/SCALE between the cumulative histograms, what
# some thousand independent pixels leave undecided; it weighs as much as one standard
# deviation of a prior.
SCALE = 60.0
# The covered share of the whole sky is one number beside the bins of a histogram.
COVERAGE_SCALE = 2 * SCALE
# By how much another draw of the same clouds changes the covered share f of one block
# of the image: BLOCK_SPREAD where f is a half, less towards clear and overcast blocks,
# and BLOCK_FLOOR there. A histogram does not see where clouds are; this keeps them in
# their place.
BLOCK_SPREAD = 0.15
BLOCK_FLOOR = 0.03
# A block of which less than this share has been seen says less, in proportion.
BLOCK_ENOUGH = 0.5


class Problem(eqx.Module):
    """Everything that stays as it is during a fit.

    **Fields:**

    - `scene`: at the parameters' defaults; without what only views are made of.
    - `view`: of the rays; eq. (1) is linear in it, and no parameter changes it.
    - `bins`, `observed`: of each of the scene's bands: [bands] and [bands bins].
    - `cloud_fraction`: observed, of the whole image.
    - `block_of_ray`, `block_rays`: the block of the image that each ray is in, and the
      number of rays in each block.
    - `block_fraction`: observed cloud fraction of each block, of its good pixels.
    - `block_weight`: how much each block has a say, 1 where it is seen, 0 where not.
    - `parameters`, `rule`: static.
    """

    scene: Scene
    view: View
    bins: Bins
    observed: Float[Array, "bands bins"]
    cloud_fraction: Float[Array, ""]
    block_of_ray: Int[Array, " rays"]
    block_rays: Float[Array, " blocks"]
    block_fraction: Float[Array, " blocks"]
    block_weight: Float[Array, " blocks"]
    parameters: tuple[Parameter, ...] = eqx.field(static=True)
    rule: CloudRule = eqx.field(static=True)


def simulate(
    problem: Problem, values: Float[Array, " parameters"]
) -> tuple[Float[Array, "bands rays"], Float[Array, " rays"]]:
    """Radiances of the rays and the share of each that is selected as cloud."""
    seen = _seen(values, problem)
    scene = put_all(problem.scene, problem.parameters, values)
    return seen, problem.rule.weights(seen, scene)


def _total(values, problem: Problem, view: View) -> Float[Array, "bands rays"]:
    scene = put_all(problem.scene, problem.parameters, values)
    return scene.total(radiances(scene, view))


@eqx.filter_custom_jvp
def _seen(values, problem: Problem) -> Float[Array, "bands rays"]:
    """Radiances of the rays, with derivatives by the values in either mode."""
    return _total(values, problem, problem.view)


@_seen.def_jvp
def _seen_jvp(primals, tangents):
    """The product with a Jacobian that does not depend on the tangent.

    A ray has fewer bands than parameters and knows nothing of other rays: its rows are
    found backwards, all bands at once, and serve every tangent. Forwards, each tangent
    is carried through all steps of all rays.
    """
    values, problem = primals
    change, of_problem = tangents
    if jax.tree.leaves(of_problem):
        raise NotImplementedError("A fit has derivatives by its parameters only.")
    seen, jacobian = _with_jacobian(values, problem)
    return seen.T, jnp.einsum("rbp,p->br", jacobian, change)


def _with_jacobian(
    values, problem: Problem
) -> tuple[Float[Array, "rays bands"], Float[Array, "rays bands parameters"]]:
    def of_ray(i):
        view = problem.view[i[None]]

        def seen(values):
            bands = _total(values, problem, view)[:, 0]
            return bands, bands

        jacobian, bands = jax.jacrev(seen, has_aux=True)(values)
        return bands, jacobian

    rays = jnp.arange(problem.block_of_ray.shape[0])
    # All that so many need fits the cache of a CPU core.
    at_once = 128 if jax.default_backend() == "cpu" else 1 << 14
    return jax.lax.map(of_ray, rays, batch_size=min(at_once, len(rays)))


def residuals(
    z: Float[Array, " parameters"], problem: Problem
) -> Float[Array, " residuals"]:
    """Of the histograms band by band, of the coverage, and of the priors."""
    values = values_of(problem.parameters, z)
    seen, weights = simulate(problem, values)
    histogram = jax.vmap(spline_histogram, (0, None, 0))(seen, weights, problem.bins)
    shape = SCALE * (jax.vmap(cumulative)(histogram) - problem.observed)
    surprise = [p.surprise(values[i]) for i, p in enumerate(problem.parameters)]
    return jnp.concatenate(
        [shape.reshape(-1), _coverage(weights, problem), jnp.stack(surprise)]
    )


def _coverage(weights, problem: Problem) -> Float[Array, " one_and_blocks"]:
    whole = weights.mean() - problem.cloud_fraction
    observed = problem.block_fraction
    total = jnp.zeros_like(observed).at[problem.block_of_ray].add(weights)
    # A block that no ray fell into says nothing.
    seen = problem.block_rays > 0
    simulated = jnp.where(seen, total / jnp.maximum(problem.block_rays, 1), observed)
    spread = jnp.sqrt(BLOCK_FLOOR**2 + 4 * BLOCK_SPREAD**2 * observed * (1 - observed))
    blocks = problem.block_weight * (simulated - observed) / spread
    return jnp.concatenate([COVERAGE_SCALE * whole[None], blocks])


def pose(
    target: Target,
    scene: Scene,
    parameters: Sequence[Parameter],
    *,
    rays: int,
    seed: int,
) -> tuple[Problem, Int[np.ndarray, " rays"]]:
    """Choose rays and lay them through the scene.

    Rays are drawn from all good pixels: clouds must not come up where it is clear, and
    may where nothing is known.

    **Arguments:**

    - `scene`: of the target's imagery, at the parameters' defaults.
    - `rays`: how many, drawn by `seed`.

    **Returns:** the problem and the pixels that its rays belong to.
    """
    pixels = _draw_pixels(target, rays, seed)
    imagery = target.imagery
    view = look(scene, imagery.grid.rays(pixels), sun_direction(imagery.time))
    block = block_of_pixels(imagery.grid.shape, target.blocks)[pixels]
    bands = [target.statistics[number] for number in scene.bands]
    bins = Bins(
        jnp.asarray([b.low for b in bands]),
        jnp.asarray([b.high for b in bands]),
        bands[0].block_counts.shape[1],
    )
    problem = Problem(
        scene=_as_looked_at(scene),
        view=view,
        bins=bins,
        observed=_observed(bands, bins),
        cloud_fraction=jnp.asarray(target.cloud_fraction, float),
        block_of_ray=jnp.asarray(block),
        block_rays=jnp.asarray(
            np.bincount(block, minlength=len(target.block_valid)), float
        ),
        block_fraction=jnp.asarray(
            target.block_cloud / np.maximum(target.block_valid, 1), float
        ),
        block_weight=jnp.asarray(
            np.sqrt(np.minimum(target.block_share / BLOCK_ENOUGH, 1)), float
        ),
        parameters=tuple(parameters),
        rule=imagery.rule,
    )
    return problem, pixels


def _as_looked_at(scene: Scene) -> Scene:
    """The scene once there is a view: seeds, masks and winds serve no more.

    Scenes that differ in these alone share one compiled function.
    """
    layers = tuple(
        replace(
            layer,
            cloud=replace(layer.cloud, seed=0, mask=None, displacements=None),
        )
        if isinstance(layer.cloud, FractalCloud)
        else layer
        for layer in scene.layers
    )
    return replace(scene, layers=layers)


def _observed(bands, bins: Bins) -> Float[Array, "bands bins"]:
    """Cumulative histograms, deposited as the simulated ones are."""
    values = jnp.stack([jnp.asarray(b.quantiles.equal_weights(), float) for b in bands])
    deposit = jax.vmap(spline_histogram, (0, None, 0))
    return jax.vmap(cumulative)(deposit(values, jnp.ones(values.shape[1]), bins))


def _draw_pixels(target: Target, count: int, seed: int) -> Int[np.ndarray, " rays"]:
    grid = target.imagery.grid
    usable = np.flatnonzero(grid.sees_the_earth() & target.counted)
    chosen = np.random.default_rng(seed).permutation(usable)[:count]
    return np.sort(chosen)
