"""Clear air above clouds and ground absorbs, emits and scatters light.

**Emission.** Let t(z) be the transmittance from altitude z to space along a ray, A(z)
the radiance of the air above z. A black body at z is seen as
J(z) = t(z) B(T(z)) + A(z). Cloud that leaves the share c(s) of what is behind s sends
∫ t B (-dc), and the air between ∫ c (-dA); by parts that is ∫ J (-dc) + c_end J_clear.
So cloud under air is cloud in the clear whose Planck function is J: its weights along
the ray need no change.

**Sunlight.** What is seen of a layer with reflectance r under air of path reflectance
ρ, transmittances T of sun and view and spherical albedo s is ρ + T T₀ r/(1 - s r)
(Vermote et al. 1997, IEEE TGRS 35, 675, eq. 2), dimmed by the gases along both slants.
"""

import itertools
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from cloudjax.geometry.geodesy import MEAN_RADIUS_M, dot
from cloudjax.geometry.on_host import compiled_for_many
from cloudjax.geometry.path import device_array
from cloudjax.geometry.rays import GroundPoints, Rays
from cloudjax.geometry.shells import Shell
from cloudjax.light.bands import EmissiveBands, ReflectiveBands

from . import gases, rayleigh
from .atmosphere import AbstractTemperature
from .gases import LEVELS_M, Columns
from .profile_grid import ProfileGrid


# Optical depth straight up from sea level; a band leaves out parts of the air that are
# thinner.
LEAST_DEPTH = 0.005
# Scale height of the air. At twilight the height of the Earth's shadow is told in it.
_SCALE_HEIGHT_M = 8e3


class Column(eqx.Module):
    """A column is the air along each ray, at the altitudes `gases.LEVELS_M`.

    **Fields:**

    - `above`: absorbers, straight up; None where they are those of the scene's own
      temperature and humidity.
    - `temperature_k`: None where the scene's own serves.
    - `view`, `sun`: one over the lengths of slants, which are cosines but near the
      horizon.
    - `daylight`: share of the scattering air that the sun still reaches at twilight.
    - `scattering`: cosine of the angle between the sun's rays and the light seen.
    """

    above: Columns | None
    temperature_k: Float[Array, "rays levels"] | None
    view: Float[Array, " rays"]
    sun: Float[Array, " rays"]
    daylight: Float[Array, " rays"]
    scattering: Float[Array, " rays"]


class Air(eqx.Module):
    """This is the air of a scene; viewers are above it.

    **Fields:**

    - `specific_humidity`: at `gases.LEVELS_M`, where there are no `profiles`.
    - `profiles`: temperature and humidity that differ from place to place; None for
      the scene's own temperature everywhere.
    - `absorbed`, `scattered`: the ABI bands in which gases and Rayleigh scattering
      count. What is not listed is neither computed nor compiled.
    """

    specific_humidity: Float[Array, " levels"]
    absorbed: tuple[int, ...] = eqx.field(static=True)
    scattered: tuple[int, ...] = eqx.field(static=True)
    profiles: ProfileGrid | None = None

    @classmethod
    def of_bands(
        cls,
        bands: Sequence[int],
        specific_humidity: Float[np.ndarray, " levels"] | None = None,
        profiles: ProfileGrid | None = None,
    ) -> "Air":
        """Make the air with every part that is thicker than 0.005 in a band, straight
        up through the US standard atmosphere.
        """
        if specific_humidity is None:
            specific_humidity = gases.standard_humidity()
        scattered = gases.scattering_depth(bands) > LEAST_DEPTH
        absorbed = gases.standard_depth(bands) > LEAST_DEPTH
        return cls(
            device_array(specific_humidity),
            tuple(b for b, counts in zip(bands, absorbed, strict=True) if counts),
            tuple(b for b, counts in zip(bands, scattered, strict=True) if counts),
            profiles,
        )

    def look(
        self,
        rays: Rays,
        ground: GroundPoints,
        sun_direction: Float[np.ndarray, "3"],
    ) -> Column:
        """Find the air along rays, on the host, as it is where they meet the ground."""
        sun = ground.upward @ sun_direction
        above = known = None
        if self.profiles is not None:
            found = _columns_at(ground, self.profiles)
            above, known = jax.tree.map(device_array, found)
        # Where the sun is below the horizon the Earth's shadow is z = R μ²/2 high.
        shadow = MEAN_RADIUS_M / 2 * np.minimum(sun, 0) ** 2 / _SCALE_HEIGHT_M
        return Column(
            above,
            known,
            view=device_array(1 / gases.airmass(-dot(ground.upward, rays.direction))),
            sun=device_array(1 / gases.airmass(sun)),
            daylight=device_array(np.exp(-shadow)),
            scattering=device_array(rays.direction @ sun_direction),
        )

    def above(self, column: Column, temperature: AbstractTemperature) -> Columns:
        """Return the absorbers above `LEVELS_M` along each ray, straight up.

        **Arguments:** `temperature`: of the scene.
        """
        if column.above is not None:
            return column.above
        same = gases.columns(temperature(LEVELS_M), self.specific_humidity)
        shape = (*column.sun.shape, len(LEVELS_M))
        return jax.tree.map(lambda x: jnp.broadcast_to(x[None], shape), same)

    def emission(
        self, bands: EmissiveBands, column: Column, temperature: AbstractTemperature
    ) -> "Emission":
        """Find what the air above each of `gases.LEVELS_M` emits and lets through,
        along each ray.
        """
        above = self.above(column, temperature)
        kelvin = column.temperature_k
        if kelvin is None:
            kelvin = temperature(LEVELS_M)[None]
        shape = (len(bands.numbers), *above.pressure.shape)
        planck = jnp.broadcast_to(bands.planck(kelvin), shape)
        through, own = jnp.ones_like(planck), jnp.zeros_like(planck)
        rows = _rows(bands.numbers, self.absorbed)
        if rows.size:
            slant = 1 / column.view[:, None]
            depth = gases.optical_depth(_of(bands.numbers, rows), above, slant)
            sent = _emission(planck[rows], depth)
            through, own = through.at[rows].set(sent[0]), own.at[rows].set(sent[1])
        return Emission(planck, through, own)

    def veil(
        self,
        bands: ReflectiveBands,
        column: Column,
        temperature: AbstractTemperature,
        altitude_m: Float[Array, " rays"],
    ) -> "Veil":
        """Find how the air above these altitudes [m] dims and brightens sunlight."""
        place = _Place.at(altitude_m[:, None])
        above = self.above(column, temperature)
        above = jax.tree.map(lambda x: place.read(x)[:, 0], above)
        path = jnp.zeros((len(bands.numbers), *altitude_m.shape))
        passed, albedo = jnp.ones_like(path), jnp.zeros_like(path)
        rows = _rows(bands.numbers, self.scattered)
        if rows.size:
            depth = gases.scattering_depth(_of(bands.numbers, rows))
            τ = jnp.asarray(depth, float)[:, None] * above.pressure[None]
            sun, view, daylight, scattering = (
                jnp.broadcast_to(x[None], τ.shape)
                for x in (column.sun, column.view, column.daylight, column.scattering)
            )
            own = sun * daylight * rayleigh.reflectance(τ, sun, view, scattering)
            both = rayleigh.transmittance(τ, sun) * rayleigh.transmittance(τ, view)
            path, passed = path.at[rows].set(own), passed.at[rows].set(both)
            albedo = albedo.at[rows].set(rayleigh.spherical_albedo(τ))
        rows = _rows(bands.numbers, self.absorbed)
        if rows.size:
            slants = 1 / column.sun + 1 / column.view
            depth = gases.optical_depth(_of(bands.numbers, rows), above, slants)
            gas = jnp.ones_like(path).at[rows].set(jnp.exp(-depth))
            path, passed = path * gas, passed * gas
        return Veil(path, passed, albedo)


@compiled_for_many(exact=False)
def _columns_at(places: GroundPoints, profiles: ProfileGrid):
    """Absorbers above places, and their temperatures."""
    kelvin, humidity = profiles(places.latitude_deg, places.longitude_deg)
    return gases.columns(kelvin, humidity), kelvin


class Emission(eqx.Module):
    """This is what the air along rays emits, at `gases.LEVELS_M`, in the units of the
    bands.

    **Fields:**

    - `planck`: B of the air's temperature.
    - `through`: t, transmittance to space.
    - `own`: A, radiance of the air above.
    """

    planck: Float[Array, "bands rays levels"]
    through: Float[Array, "bands rays levels"]
    own: Float[Array, "bands rays levels"]

    def black_bodies(
        self, altitude_m: Float[Array, "rays steps"], shell: Shell
    ) -> Float[Array, "bands rays steps"]:
        """Return J, the radiance of black bodies as warm as the air, seen from space,
        at altitudes [m] within a shell.

        Its logarithm is linear between levels, as Planck's nearly is.
        """
        first = max(int(np.searchsorted(LEVELS_M, shell.bottom_m, "right")) - 1, 0)
        last = int(np.searchsorted(LEVELS_M[:-1], shell.top_m))
        near = slice(first, last + 1)
        black = self.through[..., near] * self.planck[..., near] + self.own[..., near]
        black = jnp.log(jnp.maximum(black, 1e-30))[..., None]
        found = black[..., 0, :]
        # Few levels are near: sums over all of them are faster than a search.
        for i, (low, high) in enumerate(itertools.pairwise(LEVELS_M[near])):
            share = jnp.clip((altitude_m - low) / (high - low), 0, 1)[None]
            found = found + (black[..., i + 1, :] - black[..., i, :]) * share
        return jnp.exp(found)

    def above(self, altitude_m: Float[Array, " rays"]) -> Float[Array, "bands rays"]:
        """Return the radiance of the air above these altitudes [m]."""
        return _Place.at(altitude_m[:, None]).read(self.own)[..., 0]

    def over(
        self, radiance: Float[Array, "bands rays"], altitude_m: Float[Array, " rays"]
    ) -> Float[Array, "bands rays"]:
        """Return how radiance that leaves the ground at these altitudes [m] is seen
        from space.
        """
        place = _Place.at(altitude_m[:, None])
        return (
            place.read(self.through)[..., 0] * radiance + place.read(self.own)[..., 0]
        )


class Veil(eqx.Module):
    """A veil is the air in front of something that reflects sunlight.

    **Fields:**

    - `path`: reflectance factor πL/E of the air alone.
    - `passed`: its transmittance, down and up, in the diffuse light too.
    - `albedo`: share of the light from below that it sends back.
    """

    path: Float[Array, "bands rays"]
    passed: Float[Array, "bands rays"]
    albedo: Float[Array, "bands rays"]

    def over(
        self, reflectance: Float[Array, "bands rays"], sun: Float[Array, " rays"]
    ) -> Float[Array, "bands rays"]:
        """Return the reflectance factor of what is below, seen through the air, without
        `path`.

        **Arguments:** `sun`: of the `Column`.
        """
        below = jnp.clip(reflectance / sun[None], 0, 1)
        return self.passed * reflectance / (1 - self.albedo * below)


class _Place(eqx.Module):
    """Between which levels altitudes are."""

    level: Int[Array, "rays steps"]
    share: Float[Array, "rays steps"]

    @classmethod
    def at(cls, altitude_m: Float[Array, "rays steps"]) -> "_Place":
        levels = jnp.asarray(LEVELS_M, float)
        above = jnp.searchsorted(levels, altitude_m, "right", method="compare_all")
        level = jnp.clip(above - 1, 0, len(LEVELS_M) - 2)
        share = (altitude_m - levels[level]) / (levels[level + 1] - levels[level])
        return cls(level, jnp.clip(share, 0, 1))

    def read(
        self, values: Float[Array, "*bands rays levels"]
    ) -> Float[Array, "*bands rays steps"]:
        """Interpolate values linearly between the levels."""
        # Bands come last, so that one read fetches them all. XLA would work the values
        # out anew for each read.
        table = jnp.moveaxis(values.reshape(-1, *values.shape[-2:]), 0, -1)
        table = jax.lax.optimization_barrier(table)
        ray = jnp.arange(len(table))[:, None]
        below, above = table[ray, self.level], table[ray, self.level + 1]
        found = below + self.share[..., None] * (above - below)
        shape = (*values.shape[:-2], *self.level.shape)
        return jnp.moveaxis(found, -1, 0).reshape(shape)


def _emission(planck, depth):
    """t and A, [bands rays levels]; B is linear in optical depth between levels.

    A layer of optical depth Δ sends up B_top (1 - e^-Δ) + (B_base - B_top) f, with
    f = (1 - e^-Δ)/Δ - e^-Δ.
    """
    through = jnp.exp(-depth)
    layer = jnp.maximum(depth[..., :-1] - depth[..., 1:], 0)
    thin = layer < 0.05
    series = layer / 2 - layer**2 / 3 + layer**3 / 8
    stopped = -jnp.expm1(-layer)
    exact = stopped / jnp.where(thin, 1.0, layer) - (1 - stopped)
    share = jnp.where(thin, series, exact)
    top, base = planck[..., 1:], planck[..., :-1]
    sent = through[..., 1:] * (top * stopped + (base - top) * share)
    highest = planck[..., -1:] * -jnp.expm1(-depth[..., -1:])
    own = jnp.concatenate([sent, highest], axis=-1)
    # As in `march`, a product with ones is faster than a running sum.
    above = jnp.tril(jnp.ones((own.shape[-1], own.shape[-1]), own.dtype))
    return through, jnp.matmul(own, above, precision="highest")


def _rows(numbers: Sequence[int], counted: Sequence[int]) -> Int[np.ndarray, " rows"]:
    """Which of the bands count."""
    return np.flatnonzero(np.isin(numbers, counted))


def _of(numbers: Sequence[int], rows: Int[np.ndarray, " rows"]) -> list[int]:
    return [numbers[row] for row in rows]
