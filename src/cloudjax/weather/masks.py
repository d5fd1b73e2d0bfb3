"""Weather masks say where each class of cloud may stand, from a weather analysis.

Schinder et al. (2024, section 2.2 and Table 1) decide from humidity, temperature and
vertical wind at one altitude whether a class of cloud is present. Here the decision is
a cloud *fraction* with soft edges, and the mask that enters the cloud function is its
probit, so that a standardised texture cut at zero covers just that fraction.
"""

import abc
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer
from jaxtyping import Array, Float
from numpy.typing import ArrayLike

from cloudjax.geometry.arrays import namespace
from cloudjax.geometry.geodesy import angles_of, up
from cloudjax.geometry.latlon_grid import AnyArray, LatLonGrid, Scalar

from .advection import DisplacementMap
from .evidence import Evidence


# Narrower edges than this are indistinguishable from a step, and its square still
# divides in float32.
_NARROWEST = 1e-12
# Rounds off the infinite slope of Sundqvist's root at saturation; error below 1e-3.
_ROOT_SOFTENING = 1e-6


class Conditions(eqx.Module):
    """`Conditions` say when a class of cloud is present: one row of Schinder et al.
    (2024), Table 1.

    - `sampling_altitude_m`: where the analysis is sampled.
    - `shell_bottom_m`, `shell_top_m`: the shell the cloud fills.
    - `vertical_wind_min_pa_s`, `vertical_wind_max_pa_s`: interval of v_z, upwards as
      `cloud_fraction` defines it; the ends may be infinite.
    - `temperature_min_k`, `temperature_max_k`: interval of temperature.
    - `critical_relative_humidity`: fraction (0 to 1) below which no cloud forms. The
      paper samples humidity but prints no limit, so this is ours.
    - `vertical_wind_width_pa_s`, `temperature_width_k`: scale s of the logistic edges
      1/(1 + exp(-(x - edge)/s)), which rise from 12 % to 88 % over 4 s. Zero is the
      paper's yes or no; two classes that share an edge and a width add up to one there.
    - `evidence`: which part of the cloud of an analysis the class is, where its own
      covers and not these conditions decide; None leaves it to the class's altitude.
    """

    sampling_altitude_m: Scalar
    shell_bottom_m: Scalar
    shell_top_m: Scalar
    vertical_wind_min_pa_s: Scalar
    vertical_wind_max_pa_s: Scalar
    temperature_min_k: Scalar
    temperature_max_k: Scalar
    critical_relative_humidity: Scalar
    vertical_wind_width_pa_s: Scalar
    temperature_width_k: Scalar
    evidence: Evidence | None = eqx.field(static=True, default=None)

    def __check_init__(self):
        if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(self)):
            return
        for low, high in (
            ("shell_bottom_m", "shell_top_m"),
            ("vertical_wind_min_pa_s", "vertical_wind_max_pa_s"),
            ("temperature_min_k", "temperature_max_k"),
        ):
            if not getattr(self, low) < getattr(self, high):
                raise ValueError(f"{low} must be less than {high}.")
        if not 0 <= self.critical_relative_humidity < 1:
            raise ValueError(
                "critical_relative_humidity is a fraction and must lie in [0, 1)."
            )
        if not (self.vertical_wind_width_pa_s >= 0 and self.temperature_width_k >= 0):
            raise ValueError("The widths of the soft edges must not be negative.")


def _above(value, edge, width):
    """Soft indicator of value > edge; an infinite edge needs no arithmetic."""
    finite = jnp.isfinite(edge)
    gap = value - jnp.where(finite, edge, 0.0)
    soft = jax.nn.sigmoid(gap / jnp.maximum(width, _NARROWEST))
    return jnp.where(finite, soft, jnp.where(edge < 0, 1.0, 0.0))


def _within(value, low, high, width):
    return _above(value, low, width) * _above(-value, -jnp.asarray(high), width)


def _sundqvist(relative_humidity, critical):
    dryness = jnp.clip((1 - relative_humidity) / (1 - critical), 0, 1)
    softened = jnp.sqrt(dryness + _ROOT_SOFTENING) - _ROOT_SOFTENING**0.5
    return 1 - softened / ((1 + _ROOT_SOFTENING) ** 0.5 - _ROOT_SOFTENING**0.5)


def suitability(
    conditions: Conditions,
    temperature_k: Float[AnyArray, "*points"],
    omega_pa_s: Float[AnyArray, "*points"],
    *,
    omega_sign: float = -1.0,
) -> Float[Array, "*points"]:
    """Return how well vertical motion and temperature suit a class of cloud, 0 to 1.

    **Arguments:** as of `cloud_fraction`.

    **Returns:** the product of the soft indicators. Where any input is NaN it is zero.
    """
    fields = [jnp.asarray(field) for field in (temperature_k, omega_pa_s)]
    missing = jnp.isnan(fields[0]) | jnp.isnan(fields[1])
    # replaced before the arithmetic: NaN behind a `where` still reaches the gradient
    temperature, omega = (jnp.where(missing, 0.0, field) for field in fields)
    c = conditions
    rising = _within(
        omega_sign * omega,
        c.vertical_wind_min_pa_s,
        c.vertical_wind_max_pa_s,
        c.vertical_wind_width_pa_s,
    )
    tempered = _within(
        temperature, c.temperature_min_k, c.temperature_max_k, c.temperature_width_k
    )
    return jnp.where(missing, 0.0, rising * tempered)


def cloud_fraction(
    conditions: Conditions,
    relative_humidity: Float[AnyArray, "*points"],
    temperature_k: Float[AnyArray, "*points"],
    omega_pa_s: Float[AnyArray, "*points"],
    *,
    omega_sign: float = -1.0,
) -> Float[Array, "*points"]:
    """Return the fraction of the sky that a class of cloud covers, between 0 and 1.

    Humidity gives the fraction of Sundqvist et al. (1989, Mon. Wea. Rev. 117, 1641),
    C = 1 - sqrt((1 - RH)/(1 - RH_c)), and the conditions of Table 1 of Schinder et al.
    (2024) multiply it by soft indicators.

    **Arguments:**

    - `conditions`: the class of cloud.
    - `relative_humidity`: 0 to 1 (not per cent), at `conditions.sampling_altitude_m`;
      outside it is clipped.
    - `temperature_k`, `omega_pa_s`: there too. Omega is dp/dt, positive *downwards*, as
      in GFS VVEL.
    - `omega_sign`: v_z = omega_sign · omega. Table 1 gives v_z in Pa/s, the unit of
      omega, while the text needs rising air; -1 reads v_z as upward motion, +1 takes
      the printed inequality on omega itself.

    **Returns:** the fraction. Where any input is NaN it is zero.
    """
    humidity = jnp.asarray(relative_humidity)
    missing = jnp.isnan(humidity)
    known = jnp.where(missing, 0.0, humidity)
    fraction = _sundqvist(known, conditions.critical_relative_humidity)
    suits = suitability(conditions, temperature_k, omega_pa_s, omega_sign=omega_sign)
    return jnp.where(missing, 0.0, fraction * suits)


def fraction_to_mask(
    fraction: Float[AnyArray, "*points"], *, smallest: float = 1e-4
) -> Float[Array, "*points"]:
    """Turn a cloud fraction into the weather mask w = Φ⁻¹(fraction), in units of the
    cloud function.

    Textures are standardised, so where their weighted sum has unit variance and a
    normal distribution, the level set `sum + w > 0` covers `fraction`.

    **Arguments:**

    - `fraction`: cloud fraction; clipped to [0, 1], NaN counts as 0.
    - `smallest`: the fraction is squeezed linearly into [smallest, 1 - smallest], where
      the probit and its slope (at most 1/φ(w), 2500 at 1e-4) are finite. Unlike a clip,
      this leaves a clear sky a way back. Coverage is wrong by at most `smallest`.
    """
    fraction = jnp.asarray(fraction)
    known = jnp.where(jnp.isnan(fraction), 0.0, fraction)
    return jax.scipy.special.ndtri(
        smallest + (1 - 2 * smallest) * jnp.clip(known, 0.0, 1.0)
    )


class AbstractMask(eqx.Module):
    """A mask says where the weather lets a class of cloud stand: it is w of the cloud
    function.
    """

    @abc.abstractmethod
    def __call__(
        self,
        latitude_deg: Float[AnyArray, "*points"],
        longitude_deg: Float[AnyArray, "*points"],
    ) -> Float[AnyArray, "*points"]:
        """Read the mask at these places [degrees]; numpy in, numpy out.

        For many places it is compiled, in the precision of the device: JAX in, JAX out.
        """


class MaskGrid(AbstractMask):
    """A `MaskGrid` holds a weather mask on a regular grid; call it with latitudes and
    longitudes.

    Build it with `MaskGrid.from_fraction`, or from mask values without NaN.
    """

    mask: Float[Array, "lat lon"]
    grid: LatLonGrid

    def __check_init__(self):
        if self.mask.shape != self.grid.shape:
            raise ValueError(
                f"The mask has shape {self.mask.shape}, its axes {self.grid.shape}."
            )
        if not isinstance(self.mask, Tracer) and jnp.any(jnp.isnan(self.mask)):
            raise ValueError("The mask holds NaN; use MaskGrid.from_fraction.")

    @classmethod
    def from_fraction(
        cls,
        fraction: Float[AnyArray, "lat lon"],
        latitude_deg: ArrayLike,
        longitude_deg: ArrayLike,
    ) -> "MaskGrid":
        """Make the mask of a cloud fraction; NaN counts as clear.

        **Arguments:**

        - `fraction`: [lat, lon], 0 to 1. On a grid round the whole circle, rows at ±90
          are averaged: a pole is one place.
        - `latitude_deg`, `longitude_deg`: as for `LatLonGrid.from_axes`.
        """
        grid = LatLonGrid.from_axes(latitude_deg, longitude_deg)
        known = jnp.nan_to_num(jnp.asarray(fraction), nan=0.0)
        known = grid.single_valued_poles(known[..., None])[..., 0]
        return cls(fraction_to_mask(known), grid)

    def __call__(
        self,
        latitude_deg: Float[AnyArray, "*points"],
        longitude_deg: Float[AnyArray, "*points"],
    ) -> Float[AnyArray, "*points"]:
        """Return the mask at these points [degrees], bilinear; numpy in, numpy out.

        Outside a regional grid, and between the outermost row and the pole, the value
        of the edge is held.
        """
        nodes = self.mask[..., None]
        return self.grid.sample(nodes, latitude_deg, longitude_deg)[..., 0]


class UniformMask(AbstractMask):
    """A `UniformMask` is the same everywhere.

    **Fields:** `mask`: w.
    """

    mask: Float[Array, ""]

    @classmethod
    def from_fraction(cls, fraction: float) -> "UniformMask":
        """Make the mask of a cloud fraction from 0 to 1."""
        return cls(fraction_to_mask(jnp.asarray(fraction, float)))

    def __call__(
        self,
        latitude_deg: Float[AnyArray, "*points"],
        longitude_deg: Float[AnyArray, "*points"],
    ) -> Float[AnyArray, "*points"]:
        """Give the same value for all places."""
        del longitude_deg
        places: Any = latitude_deg
        xp = namespace(places)
        return xp.broadcast_to(xp.asarray(self.mask), places.shape)


class DrawnMask(AbstractMask):
    """A `DrawnMask` is a weather mask that the wind has drawn out.

    **Fields:** `mask`: before. `displacement`: from where air is to where it was then.
    """

    mask: AbstractMask
    displacement: DisplacementMap

    def __call__(
        self,
        latitude_deg: Float[AnyArray, "*points"],
        longitude_deg: Float[AnyArray, "*points"],
    ) -> Float[AnyArray, "*points"]:
        """Read the mask where the air at these places [degrees] came from."""
        places: Any = latitude_deg, longitude_deg
        source: Any = self.displacement.upwind(up(*places))
        return self.mask(*angles_of(source))


class BlendedMask(AbstractMask):
    """A `BlendedMask` is a weighted mean of masks, such as those of two times.

    **Fields:** `parts`: the masks; `weights`: they add up to 1.
    """

    parts: tuple[AbstractMask, ...]
    weights: Float[AnyArray, " parts"]

    def __call__(
        self,
        latitude_deg: Float[AnyArray, "*points"],
        longitude_deg: Float[AnyArray, "*points"],
    ) -> Float[AnyArray, "*points"]:
        """Return the mean at these places [degrees]."""
        total = 0 * latitude_deg
        for weight, part in zip(self.weights, self.parts, strict=True):
            total = total + weight * part(latitude_deg, longitude_deg)
        return total
