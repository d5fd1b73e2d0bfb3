"""What the marcher asks of a source of cloud."""

import abc
from typing import Any

import equinox as eqx
from jaxtyping import Array, Float

from cloudjax.geometry.footprint import Footprint
from cloudjax.geometry.rays import Rays
from cloudjax.geometry.shells import Chords, Shell


class Occupancy(eqx.Module):
    """How much of each step of each ray is cloud.

    **Fields:**

    - `fraction`: in [0, 1], for each of the possible sub-pixel structures.
    - `weights`: of those structures, adding up to 1.
    - `slopes`: of its surface; needed for normals only.
    """

    fraction: Float[Array, "nodes rays steps"]
    weights: Float[Array, " nodes"]
    slopes: "Slopes | None"


class Slopes(eqx.Module):
    """How the cloud function rises into the cloud, at points in equal parts of rays.

    What changes within few steps, and only with altitude, is told apart.

    **Fields:**

    - `gradient`: into the cloud, but for `rise`.
    - `rise`: along the vertical, at each step.
    - `up`: the vertical.
    - `unresolved`: variance of each component of the gradient below the resolution.
    """

    gradient: Float[Array, "3 rays points"]
    rise: Float[Array, "rays steps"]
    up: Float[Array, "3 rays points"]
    unresolved: Float[Array, " rays"]


class AbstractCloudSource(eqx.Module):
    """A source of extinction along rays: fractal clouds, particles, gridded water.

    A source answers in two parts, so that a fit can hold on to the first: `sample`
    does all that depends on where the rays run, `occupancy` all that depends on the
    parameters.

    **Fields:** `shell`: the air that holds all of it.
    """

    shell: eqx.AbstractVar[Shell]

    @abc.abstractmethod
    def make_textures(self, footprint: Footprint, resolution: int) -> tuple:
        """The data that `sample` reads, averaged over a kind of pixel."""

    @abc.abstractmethod
    def navigate(
        self,
        rays: Rays,
        chord: Chords,
        mask=None,
        displacements=None,
        *,
        knots: int,
        footprint: Footprint,
    ) -> Any:
        """The ways of rays along chords, on the host in float64.

        **Arguments:**

        - `mask`: a callable from latitude and longitude in degrees to w; none is 0.
        - `displacements`: one displacement map, or one for each texture; None for
          still air.
        - `knots`: points of a chord between which masks and winds are linear.
        - `footprint`: of the pixels.

        **Returns:** a module that holds the `path`.
        """

    @abc.abstractmethod
    def likelihood(self, way) -> Float[Array, " rays"]:
        """Of cloud anywhere on a way; rays of none need not be marched.

        **Arguments:** `way`: or samples of one.
        """

    @abc.abstractmethod
    def sample(self, way, textures, *, steps: int, with_gradient: bool) -> Any:
        """What the source needs along the rays, to be marched in so many steps.

        **Returns:** a module that holds the `path`, and has a method `on(path, at)` for
        the same at other places.
        """

    @abc.abstractmethod
    def branch(
        self,
        way,
        distance_m: Float[Array, " rays"],
        direction: Float[Array, "3"],
        ends_m: Float[Array, "rays ends"],
    ) -> Any:
        """Ways that leave others in one direction, on the device; `sample` takes them.

        **Arguments:**

        - `distance_m`: from the entry of each way to where it is left; also before the
          entry or behind the exit.
        - `ends_m`: distances from there at which steps begin and end.
        """

    @abc.abstractmethod
    def occupancy(self, samples, steps: int) -> Occupancy:
        """How much of each of so many equal steps is cloud."""
