"""Several scenes as one problem: what they share has one value in all of them."""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .objective import AbstractProblem, Problem, structure_of
from .parameters import Parameters


class _Alike(eqx.Module):
    """Problems of one structure, stacked: one compiled function serves them all.

    **Fields:** `places`: of each problem's parameters among those of the joint one.
    """

    problems: Problem
    places: Int[Array, "scenes parameters"]

    @classmethod
    def of(cls, problems: Sequence[Problem], places: Sequence[Sequence[int]]):
        stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *problems)
        return cls(stacked, jnp.asarray(np.array(places)))

    def __len__(self) -> int:
        return len(self.places)

    def __getitem__(self, i: int) -> Problem:
        return jax.tree.map(lambda leaf: leaf[i], self.problems)


class JointProblem(AbstractProblem):
    """A `JointProblem` has the problems of several scenes, with some parameters in
    common.

    **Fields:**

    - `parameters`: those that are shared, once, and those that each scene has for
      itself. Their paths say nothing: each scene puts its own.
    - `groups`: scenes of one structure each, in the order of residuals.
    """

    parameters: Parameters
    groups: tuple[_Alike, ...]

    @classmethod
    def of(
        cls,
        parameters: Parameters,
        problems: Sequence[Problem],
        places: Sequence[Sequence[int]],
    ) -> "JointProblem":
        """Join problems.

        **Arguments:** `places`: where the parameters of each problem are among all.
        """
        # Numbers of Python are arrays as well once they are stacked.
        problems = [jax.tree.map(jnp.asarray, problem) for problem in problems]
        found: dict[Hashable, list[int]] = {}
        for i, problem in enumerate(problems):
            found.setdefault(structure_of(problem), []).append(i)
        groups = [
            _Alike.of([problems[i] for i in some], [places[i] for i in some])
            for some in found.values()
        ]
        return cls(parameters, tuple(groups))

    def compare(
        self, values: Float[Array, " parameters"]
    ) -> tuple[Float[Array, " residuals"], list[list[Float[Array, "scenes _ _ _"]]]]:
        """See `AbstractProblem`: scene by scene."""
        found = [
            _compare(values[group.places], group.problems) for group in self.groups
        ]
        rows = [of_group.reshape(-1) for of_group, _ in found]
        return jnp.concatenate(rows), [sums for _, sums in found]

    def quarter(self, number: int) -> "JointProblem":
        """See `AbstractProblem`."""
        groups = [
            replace(group, problems=group.problems.quarter(number))
            for group in self.groups
        ]
        return replace(self, groups=tuple(groups))

    def scenes(self, sums: Any) -> Iterator[tuple[Problem, list]]:
        """See `AbstractProblem`."""
        for group, of_group in zip(self.groups, sums, strict=True):
            for i in range(len(group)):
                yield group[i], [some[i] for some in of_group]


@eqx.filter_custom_jvp
def _compare(values: Float[Array, "scenes parameters"], problems: Problem):
    """What is compared in each of some scenes, one after the other."""
    return jax.lax.map(lambda one: one[1].compare(one[0]), (values, problems))


@_compare.def_jvp
def _compare_jvp(primals, tangents):
    """The product with a Jacobian that has each scene's own parameters as columns.

    The columns of all other scenes are zeros, and need not be carried through it. The
    sums go along beside what is differentiated.
    """
    values, problems = primals
    change, of_problems = tangents
    if jax.tree.leaves(of_problems):
        raise NotImplementedError("A fit has derivatives by its parameters only.")

    def with_jacobian(one):
        values, problem = one

        def rows(values):
            rows, sums = problem.compare(values)
            return rows, (rows, sums)

        jacobian, found = jax.jacfwd(rows, has_aux=True)(values)
        return found, jacobian

    (rows, sums), jacobian = jax.lax.map(with_jacobian, (values, problems))
    moved = jnp.einsum("srp,sp->sr", jacobian, change)
    return (rows, sums), (moved, jax.tree.map(jnp.zeros_like, sums))
