"""What a fit makes small: differences of statistics, simulated less observed.

Of the residuals tried for radiances, differences of cumulative histograms alone let
Levenberg-Marquardt find the parameters from every start (docs/decisions.md).
"""

import abc
import functools as ft
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from cloudjax import FractalCloud, Scene, View, look, radiances
from cloudjax.image.devices import shared_by_all
from cloudjax_data import sun_direction
from cloudjax_scenes.cloud_rule import CloudRule

from .functionals import Pairs, Pixels
from .parameters import Parameter, Parameters
from .ray_choice import DRAWS, draw_rays
from .statistics import Statistics
from .targets import Target, block_of_pixels


# By how much another draw of the same clouds changes the covered share f of one block
# of the image: BLOCK_SPREAD where f is a half, less towards clear and overcast blocks,
# and BLOCK_FLOOR there. A histogram does not see where clouds are; this keeps them in
# their place.
BLOCK_SPREAD = 0.15
BLOCK_FLOOR = 0.03
# A block of which less than this share has been seen says less, in proportion.
BLOCK_ENOUGH = 0.5
# Of the draws of the clouds, between which the noise of a Jacobian shows.
QUARTERS = 4


class AbstractProblem(eqx.Module):
    """What a solver makes small, of one scene or of several.

    **Fields:** `parameters`: that are fitted.
    """

    parameters: eqx.AbstractVar[Parameters]

    @abc.abstractmethod
    def compare(
        self, values: Float[Array, " parameters"]
    ) -> tuple[Float[Array, " residuals"], Any]:
        """Return all residuals but those of the priors, and the sums behind them."""

    @abc.abstractmethod
    def quarter(self, number: int) -> "AbstractProblem":
        """Return the same problem, of which only the rays that see a quarter of the
        draws of the clouds move with the parameters.
        """

    @abc.abstractmethod
    def scenes(self, sums: Any) -> Iterator[tuple["Problem", list]]:
        """Yield the problem and the sums of each scene, in the order of residuals."""


class Problem(AbstractProblem):
    """Everything that stays as it is during the fit of a scene.

    **Fields:**

    - `scene`: at the parameters' defaults; without what only views are made of.
    - `view`: of the rays; eq. (1) is linear in it, and no parameter changes it.
    - `statistics`: observed, that simulated ones are compared with.
    - `known`: 1 for rays that count, 0 for those that fill up.
    - `draw`: of the clouds, that each ray sees; `moves`: whether it has derivatives.
    - `block_of_ray`, `block_rays`: the block of the image that each ray is in, and the
      number of rays in each block.
    - `pairs`: of rays that are neighbours.
    - `block_fraction`: observed cloud fraction of each block, of its good pixels.
    - `block_weight`: how much each block has a say, 1 where it is seen, 0 where not.
    - `parameters`: that are fitted; `rule`: static.
    """

    scene: Scene
    view: View
    statistics: Statistics
    known: Float[Array, " rays"]
    draw: Int[Array, " rays"]
    moves: Bool[Array, " rays"]
    block_of_ray: Int[Array, " rays"]
    block_rays: Float[Array, " blocks"]
    pairs: Pairs
    block_fraction: Float[Array, " blocks"]
    block_weight: Float[Array, " blocks"]
    parameters: Parameters
    rule: CloudRule = eqx.field(static=True)

    def compare(
        self, values: Float[Array, " parameters"]
    ) -> tuple[Float[Array, " residuals"], list[Float[Array, "blocks _ _"]]]:
        """See `AbstractProblem`: of all statistics, and of the cover of each block."""
        seen, weights = simulate(self, values)
        blocks = len(self.block_rays)
        sums = self.statistics.sums(self.pixels(seen, weights), blocks)
        found = [
            one.residuals(some)
            for one, some in zip(self.statistics.all, sums, strict=True)
        ]
        return jnp.concatenate([*found, _places(sums[-1][:, 0], self)]), sums

    def quarter(self, number: int) -> "Problem":
        """See `AbstractProblem`."""
        moves = self.draw // (DRAWS // QUARTERS) == number
        # Of several problems that are stacked, too, whose shapes `replace` refuses.
        return eqx.tree_at(lambda problem: problem.moves, self, moves)

    def scenes(self, sums: list) -> Iterator[tuple["Problem", list]]:
        """See `AbstractProblem`."""
        yield self, sums

    def pixels(self, seen: Float[Array, "bands rays"], weights) -> Pixels:
        """Return the rays as pixels."""
        radiance = seen / self.statistics.deviations[:, None]
        return Pixels(radiance, weights, self.known, self.block_of_ray, self.pairs)


def simulate(
    problem: Problem, values: Float[Array, " parameters"]
) -> tuple[Float[Array, "bands rays"], Float[Array, " rays"]]:
    """Return the radiances of the rays, and the share of each that counts as cloud."""
    seen = _seen(values, problem)
    scene = problem.parameters.put(problem.scene, values)
    weights = problem.rule.weights(seen, scene)

    def held(each):
        return jnp.where(problem.moves, each, jax.lax.stop_gradient(each))

    return held(seen), held(weights)


@eqx.filter_custom_jvp
def _seen(values, problem: Problem) -> Float[Array, "bands rays"]:
    """Radiances of the rays, with derivatives by the values in either mode.

    All devices of all processes have their shares of the rays.
    """
    see = ft.partial(_total, problem.parameters)
    return shared_by_all(see, (problem.scene, values), problem.view)


def _total(parameters: Parameters, common, view: View) -> Float[Array, "bands rays"]:
    scene, values = common
    scene = parameters.put(scene, values)
    return scene.total(radiances(scene, view))


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
    see = ft.partial(_with_jacobian, problem.parameters)
    common = problem.scene, values
    seen, jacobian = shared_by_all(see, common, problem.view)
    return seen, jnp.einsum("bpr,p->br", jacobian, change)


def _with_jacobian(
    parameters: Parameters, common, view: View
) -> tuple[Float[Array, "bands rays"], Float[Array, "bands parameters rays"]]:
    scene, values = common

    def of_ray(i):
        one = view[i[None]]

        def seen(values):
            bands = _total(parameters, (scene, values), one)[:, 0]
            return bands, bands

        jacobian, bands = jax.jacrev(seen, has_aux=True)(values)
        return bands, jacobian

    count = len(view)
    # All that so many need fits the cache of a CPU core.
    at_once = min(128 if jax.default_backend() == "cpu" else 1 << 14, count)
    # Filled up: a rest would be compiled once more.
    rays = jnp.arange(-(-count // at_once) * at_once) % count
    found = jax.lax.map(of_ray, rays, batch_size=at_once)
    return jax.tree.map(lambda each: jnp.moveaxis(each[:count], 0, -1), found)


def structure_of(problem: AbstractProblem) -> Hashable:
    """Return what problems have in common that share a compiled function."""
    leaves, tree = jax.tree.flatten(problem)
    arrays = [jax.typeof(x) if eqx.is_array(x) else x for x in leaves]
    return tree, tuple(arrays)


def residuals(
    z: Float[Array, " parameters"], problem: AbstractProblem
) -> Float[Array, " residuals"]:
    """Return the residuals of all that is compared, and of the priors."""
    return residuals_and_sums(z, problem)[0]


def residuals_and_sums(
    z: Float[Array, " parameters"], problem: AbstractProblem
) -> tuple[Float[Array, " residuals"], Any]:
    """Also return the sums that the statistics are found from."""
    rows, sums = problem.compare(problem.parameters.values(z))
    return jnp.concatenate([rows, problem.parameters.surprise(z)]), sums


def _places(
    cover: Float[Array, "blocks 2"], problem: Problem
) -> Float[Array, " blocks"]:
    """Of the covered share of each block."""
    observed = problem.block_fraction
    # A block that no ray fell into says nothing.
    seen = cover[:, 1] > 0
    simulated = jnp.where(seen, cover[:, 0] / jnp.maximum(cover[:, 1], 1), observed)
    spread = jnp.sqrt(BLOCK_FLOOR**2 + 4 * BLOCK_SPREAD**2 * observed * (1 - observed))
    return problem.block_weight * (simulated - observed) / spread


def pose(
    target: Target,
    scene: Scene,
    parameters: Sequence[Parameter],
    *,
    rays: int,
    seed: int,
    texture: bool = True,
) -> tuple[Problem, Int[np.ndarray, " rays"]]:
    """Choose rays and lay them through the scene.

    Rays are drawn from all good pixels: clouds must not come up where it is clear, and
    may where nothing is known.

    They see several draws of the clouds. A fit to a single one finds what makes this
    draw look like the image, which is not what its weather is like.

    **Arguments:**

    - `scene`: of the target's imagery, at the parameters' defaults.
    - `rays`: how many, drawn by `seed`.
    - `texture`: whether neighbouring pixels are compared.

    **Returns:** the problem and the pixels that its rays belong to.
    """
    chosen = draw_rays(target, rays, seed, texture=texture)
    imagery, pixels = target.imagery, chosen.pixels
    sun = sun_direction(imagery.time)
    view = look(scene, imagery.grid.rays(pixels), sun, chosen.draw)
    block = block_of_pixels(imagery.grid.shape, target.blocks)[pixels]
    valid = target.block_valid
    statistics = target.statistics
    problem = Problem(
        scene=_as_looked_at(scene),
        view=view,
        statistics=statistics if chosen.lags else statistics.values_alone(),
        known=jnp.asarray(chosen.known, float),
        draw=jnp.asarray(chosen.draw),
        moves=jnp.ones(len(pixels), bool),
        block_of_ray=jnp.asarray(block),
        block_rays=jnp.asarray(
            np.bincount(block, chosen.known, minlength=len(valid)), float
        ),
        pairs=Pairs.of(chosen.pairs, chosen.known),
        block_fraction=jnp.asarray(target.block_cloud / np.maximum(valid, 1), float),
        block_weight=jnp.asarray(
            np.sqrt(np.minimum(target.block_share / BLOCK_ENOUGH, 1)), float
        ),
        parameters=Parameters.of(parameters),
        rule=imagery.rule,
    )
    return problem, pixels


def _as_looked_at(scene: Scene) -> Scene:
    """The scene once there is a view: seeds, masks, winds and fields serve no more.

    Scenes that differ in these alone share one compiled function.
    """
    layers = tuple(
        replace(
            layer,
            cloud=replace(
                layer.cloud, seed=0, mask=None, displacements=None, fields=None
            ),
        )
        if isinstance(layer.cloud, FractalCloud)
        else layer
        for layer in scene.layers
    )
    return replace(scene, layers=layers)
