"""A source of cloud answers four questions of the march, in this order.

1. `shell`, `likelihood`: where can its clouds be? A likelihood is that of the present
   parameters.
2. `navigate` (host, float64) and `sample` (device): what does it need to know along the
   rays? Both depend on where the rays run and on no parameter of the clouds.
3. `narrowed`, `occupancy`: where on the ways can there be cloud now, and how much of
   each step is? They depend on the samples and on every parameter, so that all
   derivatives pass through them, and a view that was sampled once serves all
   parameters.
4. `branch`: the same ways as in 2, but along a secondary ray, for shadows.

Masks, winds and whatever else says where the clouds of a source are belong to the
source. The same tests run over all sources (tests/unit/source_contract).
"""

import abc
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from cloudjax.geometry.footprint import Sampling
from cloudjax.geometry.rays import Rays
from cloudjax.geometry.shells import Chords, Shell


class Occupancy(eqx.Module):
    """An `Occupancy` says how much of each step of each ray is cloud.

    **Fields:**

    - `fraction`: in [0, 1], for each of the possible sub-pixel structures (nodes); more
      where cloud is denser than the extinction of its layer says.
    - `weights`: of those structures; they add up to 1.
    - `slopes`: of the cloud's surface; None where no normals are asked.
    """

    fraction: Float[Array, "nodes rays steps"]
    weights: Float[Array, " nodes"]
    slopes: "Slopes | None"


class Slopes(eqx.Module):
    """`Slopes` tell how the cloud function rises into the cloud, at points of rays.

    What changes within few steps, and only with altitude, is told apart.

    **Fields:**

    - `gradient`: into the cloud, per metre, without `rise`.
    - `rise`: along the vertical, per metre, at each step.
    - `up`: the vertical, unit vectors.
    - `unresolved`: variance of each component of the gradient below the resolution.
    """

    gradient: Float[Array, "3 rays points"]
    rise: Float[Array, "rays steps"]
    up: Float[Array, "3 rays points"]
    unresolved: Float[Array, " rays"]


class AbstractCloudSource(eqx.Module):
    """A source of cloud is read along rays: fractal clouds, particles, gridded water.

    Everything that `navigate`, `sample` and `branch` return is a pytree whose leaves
    have the rays as their first axis.

    **Fields:** `shell`: the air that holds all of its clouds.
    """

    shell: eqx.AbstractVar[Shell]

    def make_textures(self) -> Any:
        """Make the data that `sample` reads, if it reads any."""
        return ()

    def drawn_anew(self, number: int) -> "AbstractCloudSource":
        """Return another draw of the same clouds; by default the source has no chance.

        Draws differ in what `make_textures` and `navigate` return, not in structure.
        """
        del number
        return self

    def points(self, sampling: Sampling) -> tuple[int, ...]:
        """Say how densely the source is read along the rays of a group.

        Groups of which all sources say the same are read together.
        """
        del sampling
        return ()

    @abc.abstractmethod
    def navigate(self, rays: Rays, chord: Chords, sampling: Sampling) -> Any:
        """Lay rays through the source along chords, on the host in float64.

        **Returns:** the ways: a module that holds the `path`.
        """

    @abc.abstractmethod
    def likelihood(self, samples: Any) -> Float[Array, " rays"]:
        """Estimate how likely a ray is to meet cloud anywhere on its way.

        **Arguments:** `samples`: or the ways.
        """

    def narrowed(self, samples: Any, steps: int) -> tuple[Any, Float[Array, " rays"]]:
        """Leave out of the ways what the parameters leave no cloud on.

        **Arguments:** `steps`: of the march through what remains.

        **Returns:** samples of what remains, and how far from the entry it begins [m].
        A source whose shell is hardly larger than its cloud leaves all as it is.
        """
        del steps
        return samples, jnp.zeros_like(samples.path.length_m)

    @abc.abstractmethod
    def sample(self, way: Any, textures: Any, *, steps: int, slopes: bool) -> Any:
        """Find what `occupancy` needs along the ways, for so many steps.

        **Arguments:** `slopes`: whether normals will be asked.

        **Returns:** a module that holds the `path`, and has a method `on(path, at)`
        that gives the same at other parts of the chord.
        """

    def unread(self, way: Any, textures: Any, *, steps: int, slopes: bool) -> Any:
        """Return in place of `sample` what ways without cloud need, and read nothing.

        The path and what `likelihood` needs are as `sample` has them. All else has only
        the same shape.

        **Returns:** None where `sample` reads so little that it may be called instead.
        """
        del way, textures, steps, slopes

    @abc.abstractmethod
    def branch(
        self,
        way: Any,
        textures: Any,
        distance_m: Float[Array, " rays"],
        direction: Float[Array, "rays 3"],
        ends_m: Float[Array, "rays ends"],
    ) -> Any:
        """Leave the ways in another direction, on the device, for `sample`.

        **Arguments:**

        - `textures`: as for `sample`.
        - `distance_m`: from the entry of each way to where it is left; also before the
          entry or behind the exit.
        - `direction`: unit vectors, ECEF.
        - `ends_m`: distances from there at which steps begin and end.
        """

    @abc.abstractmethod
    def occupancy(self, samples: Any, steps: int) -> Occupancy:
        """Find how much of each of so many equal steps is cloud."""
