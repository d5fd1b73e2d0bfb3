"""A path is the way of a ray through a shell, in small local numbers for the device."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .arrays import HostArray
from .geodesy import GRS80, Ellipsoid, curvature_radius, vertical
from .on_host import compiled_for_many
from .rays import Rays
from .shells import Chords, both_chords


class Path(eqx.Module):
    """A `Path` holds the chords of rays through one shell, each on the sphere that
    osculates the ellipsoid.

    **Fields:**

    - `length_m`: of the chord; 0 where the ray misses.
    - `entry_altitude_m`: geodetic.
    - `radius_m`: of the osculating sphere in the ray's vertical plane, to the entry.
    - `direction`: of travel, unit vector, ECEF.
    - `entry_up`: geodetic vertical at the entry, ECEF.
    - `ends_m`: distances from the entry at which steps begin and end; None where they
      are equal.
    """

    length_m: Float[Array, " rays"]
    entry_altitude_m: Float[Array, " rays"]
    radius_m: Float[Array, " rays"]
    direction: Float[Array, "rays 3"]
    entry_up: Float[Array, "rays 3"]
    ends_m: Float[Array, "rays ends"] | None = None

    def distance_m(self, steps: int) -> Float[Array, "rays {steps}"]:
        """Return the distances [m] from the entry to the middle of the steps along the
        chord.
        """
        if self.ends_m is not None:
            return (self.ends_m[:, 1:] + self.ends_m[:, :-1]) / 2
        fraction = (jnp.arange(steps, dtype=self.length_m.dtype) + 0.5) / steps
        return self.length_m[:, None] * fraction[None, :]

    def step_ends_m(self, steps: int) -> Float[Array, "rays ends"]:
        """Return the distances [m] from the entry at which the steps begin and end."""
        if self.ends_m is not None:
            return self.ends_m
        parts = jnp.arange(steps + 1, dtype=self.length_m.dtype) / steps
        return self.length_m[:, None] * parts[None]

    def altitude_m(
        self, distance_m: Float[Array, "rays steps"]
    ) -> Float[Array, "rays steps"]:
        """Return the altitude [m] after a distance [m] from the entry.

        It follows from |r + s d|² = r² + 2 r μ s + s², with the difference of squares
        divided out, so that nothing large is subtracted and float32 keeps centimetres.
        """
        r = self.radius_m[:, None]
        gained = (2 * r * self._slope()[:, None] + distance_m) * distance_m
        return self.entry_altitude_m[:, None] + gained / (r + jnp.sqrt(r**2 + gained))

    def distance_to_m(
        self, altitude_m: Float[Array, "rays points"]
    ) -> Float[Array, "rays points"]:
        """Return the distance [m] from the entry to an altitude, the inverse of
        `altitude_m`.

        It is negative before the entry, and the nearer one of two. Where the ray never
        comes so low or so high, it is that of the turning point or thereabouts.
        """
        r, gained = self.radius_m[:, None], altitude_m - self.entry_altitude_m[:, None]
        gained = (2 * r + gained) * gained
        slope = r * self._slope()[:, None]
        root = jnp.sqrt(jnp.maximum(slope**2 + gained, 1.0))
        return gained / (slope + jnp.where(slope < 0, -root, root))

    def up(
        self, distance_m: Float[Array, "rays steps"]
    ) -> Float[Array, "3 rays steps"]:
        """Return the vertical after a distance [m] from the entry, as unit vectors,
        ECEF.
        """
        start = self.radius_m[None, :] * self.entry_up.T
        position = start[..., None] + self.direction.T[..., None] * distance_m[None]
        return position / jnp.linalg.norm(position, axis=0)[None]

    def between(
        self, bottom_m: Float[Array, " rays"], top_m: Float[Array, " rays"]
    ) -> tuple[Float[Array, " rays"], Float[Array, " rays"]]:
        """Return the distances [m] from the entry between which a ray is in the air
        between two altitudes [m], at most those of the chord.

        A ray that turns within the chord is taken from the upper altitude to the same
        again, whatever lies below the lower.
        """
        low, high = self.distance_to_m(jnp.stack([bottom_m, top_m], axis=-1)).T
        turn = -self.radius_m * self._slope()
        turns = (turn > 0) & (turn < self.length_m)
        # The nearer place of an altitude and the farther one are as far from the turn.
        low = jnp.where(turns, 2 * turn - high, low)
        first, last = jnp.minimum(low, high), jnp.maximum(low, high)
        return jnp.clip(first, 0, self.length_m), jnp.clip(last, 0, self.length_m)

    def part(
        self, first_m: Float[Array, " rays"], last_m: Float[Array, " rays"]
    ) -> "Path":
        """Return the part of the chords between two distances [m] from the entry."""
        start = first_m[:, None]
        altitude = self.altitude_m(start)[:, 0]
        return Path(
            length_m=last_m - first_m,
            entry_altitude_m=altitude,
            radius_m=self.radius_m + (altitude - self.entry_altitude_m),
            direction=self.direction,
            entry_up=self.up(start)[..., 0].T,
        )

    def branch(
        self,
        distance_m: Float[Array, " rays"],
        direction: Float[Array, "rays 3"],
        ends_m: Float[Array, "rays ends"],
    ) -> "Path":
        """Leave the rays after a distance [m], in another direction.

        It runs over a sphere of the same curvature at the ground: its altitudes differ
        from those over the ellipsoid by less than 1 % of the drop of the horizon.
        """
        start = distance_m[:, None]
        altitude = self.altitude_m(start)[:, 0]
        return Path(
            length_m=ends_m[:, -1],
            entry_altitude_m=altitude,
            radius_m=self.radius_m + (altitude - self.entry_altitude_m),
            direction=direction,
            entry_up=self.up(start)[..., 0].T,
            ends_m=ends_m,
        )

    @property
    def middle_slant(self) -> Float[Array, " rays"]:
        """Return the cosine of ray and vertical in the middle of the chord."""
        half, slope = self.length_m / 2, self._slope()
        along = self.radius_m * slope + half
        across2 = self.radius_m**2 * (1 - slope**2)
        return along / jnp.sqrt(along**2 + jnp.maximum(across2, 1.0))

    def _slope(self) -> Float[Array, " rays"]:
        return (self.direction * self.entry_up).sum(-1)


def navigate(rays: Rays, chords: Chords, ellipsoid: Ellipsoid = GRS80) -> Path:
    """Bring chords onto the device; the work runs on the host, in float64."""
    return path_from(*_at_entry(rays, chords, ellipsoid))


def path_from(*parts: Float[HostArray, "..."]) -> Path:
    """Bring onto the device what `path_parts` found."""
    return Path(*map(device_array, parts))


def path_parts(
    rays: Rays,
    chords: Chords,
    entry_up: Float[HostArray, "rays 3"],
    entry_altitude_m: Float[HostArray, " rays"],
    ellipsoid: Ellipsoid = GRS80,
) -> tuple[Float[HostArray, "..."], ...]:
    """Find the fields of the paths of chords whose verticals at the entry are known."""
    radius = curvature_radius(entry_up, rays.direction, ellipsoid) + entry_altitude_m
    return chords.length_m, entry_altitude_m, radius, rays.direction, entry_up


@compiled_for_many("ellipsoid", handed_over=True)
def _at_entry(rays: Rays, chords: Chords, ellipsoid: Ellipsoid):
    return path_parts(rays, chords, *vertical(rays.at(chords.entry_m), ellipsoid))


# What `Rays.ground` and `both_chords` find, compiled where rays are many.
ground_points = compiled_for_many("ellipsoid")(Rays.ground)
find_chords = compiled_for_many("shell", "ellipsoid")(both_chords)


def points_along(
    rays: Rays, chord: Chords, knots: int
) -> list[Float[HostArray, "rays 3"]]:
    """Return ECEF positions [m] on the chords, equally far apart from the entry to the
    exit.
    """
    return [
        rays.at(chord.entry_m + chord.length_m * fraction)
        for fraction in np.linspace(0, 1, knots)
    ]


def middles(parts: int) -> Float[np.ndarray, "{parts}"]:
    """Return the middles of equal parts of a chord, which runs from 0 to 1."""
    return (np.arange(parts) + 0.5) / parts


def along_chord(
    knots: Sequence[Float[Array, "..."]] | Float[Array, "knots ..."],
    at: Float[np.ndarray, " points"],
) -> Float[Array, "... points"]:
    """Interpolate values at the knots, [... 1] each, at parts of the chord from 0 to 1.

    It is linear in between, an explicit sum of few terms.
    """
    last_axis = (1,) * (jnp.ndim(knots[0]) - 1) + (-1,)
    first, *rest = hats(len(knots), at)
    total = knots[0] * first.reshape(last_axis)
    for i, hat in enumerate(rest, start=1):
        total = total + knots[i] * hat.reshape(last_axis)
    return total


def hats(knots: int, at: Float[np.ndarray, " points"]) -> Float[np.ndarray, "k points"]:
    """Return the weight of each knot, equally far apart from 0 to 1, at points in
    between.
    """
    return np.maximum(1 - np.abs(at * (knots - 1) - np.arange(knots)[:, None]), 0)


class Profile(eqx.Module):
    """A `Profile` holds values along chords, linear in between.

    **Fields:**

    - `values`: at points equally far apart.
    - `ends`: whether the ends of the chord are among them; else they are in the middle
      of equal parts.
    """

    values: Float[Array, "rays points"]
    ends: bool = eqx.field(static=True, default=False)

    def in_steps(self, steps: int) -> Float[Array, "rays {steps}"]:
        """Return the values in the middle of equal steps."""
        points = self.values.shape[-1]
        if points == steps and not self.ends:
            return self.values
        at = middles(steps)
        share = hats(points, at) if self.ends else to_points(steps, points).T
        # This is a product of matrices, for XLA would fuse what makes the values into a
        # sum, and repeat it for each step.
        share = jnp.asarray(share, self.values.dtype)
        return jnp.matmul(self.values, share, precision="highest")

    def with_knots(self, knots: int) -> "Profile":
        """Hold the same values at more points; exact where old points remain points.

        **Raises:** `ValueError` where they do not.
        """
        stretches = self.values.shape[-1] - 1
        if knots - 1 == stretches:
            return self
        if not self.ends or (knots - 1) % stretches:
            raise ValueError(f"{stretches + 1} points cannot be held as {knots}.")
        at = np.linspace(0, 1, knots)
        share = jnp.asarray(hats(stretches + 1, at), self.values.dtype)
        values = jnp.matmul(self.values, share, precision="highest")
        return Profile(values, ends=True)

    def at(self, part: Float[Array, "rays places"]) -> Float[Array, "rays places"]:
        """Return the values at parts of the chord, from 0 to 1; within half a step of
        its ends they are held.
        """
        last = self.values.shape[-1] - 1
        place = part * last if self.ends else part * (last + 1) - 0.5
        place = jnp.clip(place, 0, last)
        low = jnp.floor(place).astype(jnp.int32)
        # Values are read by index: sums of all values, most with a weight of 0, take
        # nine times as long.
        before, after = (
            jnp.take_along_axis(self.values, i, axis=-1, mode="clip")
            for i in (low, jnp.minimum(low + 1, last))
        )
        return before + (place - low) * (after - before)


def to_points(steps: int, points: int) -> Float[np.ndarray, "{steps} {points}"]:
    """Return the share of each of a chord's steps that goes to fewer points, in the
    middle of equal parts.

    Shares are linear between points, so that Σ_s w_s g(s) = Σ_p (w @ to_points)_p g_p.
    """
    at = np.clip(middles(steps) * points - 0.5, 0, points - 1)[:, None]
    return np.maximum(1 - np.abs(at - np.arange(points)), 0)


def on_chord(
    knots: Sequence[Float[Array, "*n"]], at: Float[Array, "*#n"]
) -> Float[Array, "*n"]:
    """Interpolate values at the knots at any part of the chord, 0 its entry and 1 its
    exit.

    It is linear in between, and goes on beyond as in the first and the last stretch.
    """
    stretches = len(knots) - 1
    total = knots[0]
    for i in range(stretches):
        low, high = 0.0 if i else -jnp.inf, 1.0 if i + 1 < stretches else jnp.inf
        part = jnp.clip(at * stretches - i, low, high)
        total = total + part * (knots[i + 1] - knots[i])
    return total


def device_array(x: Float[HostArray, "..."]) -> Array:
    """Bring a host array onto the device in the default float of the running JAX."""
    if isinstance(x, np.ndarray):
        # JAX would bring float64 onto the device and convert it there.
        x = x.astype(jnp.result_type(float), copy=False)
    return jnp.asarray(x, dtype=float)
