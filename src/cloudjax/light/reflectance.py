"""Plane-parallel slabs of cloud reflect sunlight, for any sun and viewer.

Light that was scattered once is exact, with the phase function's own shape; the rest is
emulated by small networks that were fitted to the doubling method with 32 streams
(tools/make_reflectance.py). Two-stream limits are built in, so that thin slabs scatter
once, thick ones saturate, and without absorption what is not reflected is transmitted.
docs/theory/reflectance.md has the method, its domain and its measured error.

Domain: optical depths of 0.01 to 200, co-albedos of 0 to 0.5, asymmetries of 0 to 0.9,
cosines of 0.05 to 1. Beyond it values and gradients stay finite and go to their limits:
cosines are led smoothly to a floor of 0.02, asymmetries end at 0.92.
"""

import functools as ft
import importlib.resources

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .emulator import Network
from .phase import AbstractPhase


LEAST_COSINE = 0.02
LARGEST_ASYMMETRY = 0.92
# Beyond, 1/τ is nothing to float32; τ⁴ in derivatives would overflow.
LARGEST_DEPTH = 1e6


class PlaneParallel(eqx.Module):
    """A `PlaneParallel` solves homogeneous slabs over black or Lambertian surfaces.

    Optical depths are vertical. `co_albedo` is 1 - ω. Cosines are of zenith angles,
    which the sun and the viewer may swap; `scattering` is the cosine of the angle
    between the sun's rays and the light that is seen, -1 with the sun behind the
    viewer.

    **Fields:** networks for the bidirectional reflectance, for fluxes, and for the
    spherical albedo; made by `load`.
    """

    bidirectional: Network
    directional: Network
    spherical: Network

    @classmethod
    def load(cls) -> "PlaneParallel":
        """Load the networks that come with the package."""
        return cls(*(_network(name) for name in cls.__dataclass_fields__))

    def reflectance(
        self,
        optical_depth: Float[Array, "*n"],
        co_albedo: Float[Array, ""],
        phase: AbstractPhase,
        sun: Float[Array, "*n"],
        view: Float[Array, "*n"],
        scattering: Float[Array, "*n"],
    ) -> Float[Array, "*n"]:
        """Return bidirectional reflectance factor πL/(μ₀F₀) over a black surface."""
        depth = jnp.minimum(optical_depth, LARGEST_DEPTH)
        sun, view = above_horizon(sun), above_horizon(view)
        once = first_order(depth, co_albedo, phase, sun, view, scattering)
        features, scale = _pair_features(depth, co_albedo, phase, sun, view, scattering)
        (log_rest,) = self.bidirectional(_material(co_albedo, phase), features)
        return once + scale * jnp.exp(log_rest)

    def albedo_and_transmittance(
        self,
        optical_depth: Float[Array, "*n"],
        co_albedo: Float[Array, ""],
        phase: AbstractPhase,
        cosine: Float[Array, "*n"],
    ) -> tuple[Float[Array, "*n"], Float[Array, "*n"]]:
        """Return plane albedo and total (direct and diffuse) transmittance of the flux.

        Their sum is 1 without absorption.
        """
        ratios = self._directional_ratios(optical_depth, co_albedo, phase, cosine)
        return _reflected_and_transmitted(*ratios)

    def emissivity_and_albedo(
        self,
        optical_depth: Float[Array, "*n"],
        co_albedo: Float[Array, ""],
        phase: AbstractPhase,
        cosine: Float[Array, "*n"],
    ) -> tuple[Float[Array, "*n"], Float[Array, "*n"]]:
        """Return what an isothermal slab emits, over Planck's radiance, and its albedo.

        By Kirchhoff's law the emissivity is what the slab absorbs of a beam from there:
        1 - R - T, here without the difference of large numbers.
        """
        ratios = self._directional_ratios(optical_depth, co_albedo, phase, cosine)
        lost, _ = ratios
        return lost / (1 + lost), _reflected_and_transmitted(*ratios)[0]

    def _directional_ratios(self, optical_depth, co_albedo, phase, cosine):
        depth = jnp.minimum(optical_depth, LARGEST_DEPTH)
        g = _asymmetry(phase)
        cosine = above_horizon(cosine)
        features, saturation = _depth_features(depth, co_albedo, g)
        features = jnp.stack(features + _slant_features(depth, co_albedo, g, cosine))
        out = self.directional(_material(co_albedo, phase), features)
        return _ratios(out, depth, co_albedo, saturation)

    def spherical_albedo(
        self,
        optical_depth: Float[Array, "*n"],
        co_albedo: Float[Array, ""],
        phase: AbstractPhase,
    ) -> Float[Array, "*n"]:
        """Return the reflected share of light that comes from everywhere alike."""
        depth = jnp.minimum(optical_depth, LARGEST_DEPTH)
        g = _asymmetry(phase)
        features, saturation = _depth_features(depth, co_albedo, g)
        out = self.spherical(_material(co_albedo, phase), jnp.stack(features))
        ratios = _ratios(out, depth, co_albedo, saturation)
        return _reflected_and_transmitted(*ratios)[0]

    def surface_share(
        self,
        optical_depth: Float[Array, "*n"],
        co_albedo: Float[Array, ""],
        phase: AbstractPhase,
        sun: Float[Array, "*n"],
        view: Float[Array, "*n"],
        surface_albedo: Float[Array, "*n"],
    ) -> Float[Array, "*n"]:
        """Return what a Lambertian surface below adds to πL/(μ₀F₀): A T(μ₀) T(μ)/(1 - A
        R).

        Liou (2002, An Introduction to Atmospheric Radiation, eq. 6.3.31), with the
        transmittance towards the viewer by reciprocity.
        """
        slab = (optical_depth, co_albedo, phase)
        _, down = self.albedo_and_transmittance(*slab, sun)
        _, up = self.albedo_and_transmittance(*slab, view)
        echo = surface_albedo * self.spherical_albedo(*slab)
        return surface_albedo * down * up / (1 - echo)


def first_order(
    optical_depth: Float[Array, "*n"],
    co_albedo: Float[Array, ""],
    phase: AbstractPhase,
    sun: Float[Array, "*n"],
    view: Float[Array, "*n"],
    scattering: Float[Array, "*n"],
) -> Float[Array, "*n"]:
    """Return πL/(μ₀F₀) of light that was scattered once, ω P (1 -
    e^-τ(1/μ+1/μ₀))/4(μ+μ₀).
    """
    slant = optical_depth * (sun + view) / (sun * view)
    strength = (1 - co_albedo) / 4 * phase(scattering)
    return strength * -jnp.expm1(-slant) / (sun + view)


def above_horizon(cosine: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Return a smooth maximum of a cosine and 0.02, 1.003 times a cosine of 0.05."""
    above = cosine - LEAST_COSINE
    return LEAST_COSINE + (above + jnp.sqrt(above**2 + 0.004**2)) / 2


def _asymmetry(phase):
    return jnp.minimum(phase.asymmetry, LARGEST_ASYMMETRY)


def _material(co_albedo, phase):
    """What the mixers see; √(1-ω) rules thick clouds, but has no slope at ω = 1.

    Phase functions are told apart by how their moments differ from gⁿ, those of Henyey
    and Greenstein.
    """
    albedo, g = 1 - co_albedo, _asymmetry(phase)
    transport = 1 - albedo * g
    _, second, third, fourth = phase.moments
    return jnp.stack(
        [
            2 * co_albedo - 1,
            2 * g - 1,
            2 * jnp.sqrt(co_albedo / transport + 1e-4) - 1,
            jnp.log(co_albedo + 1e-3) / 3 + 1,
            1 / (3 * (0.1 + transport)) - 1,
            3 * (second - g**2),
            3 * (third - g**3),
            3 * (fourth - g**4),
        ]
    )


def _saturation(depth, co_albedo, g):
    """(kτ)² of two streams, and the depth that they see: τ(1 - ωg), at most 1/k."""
    transport = 1 - (1 - co_albedo) * g
    x2 = 3 * co_albedo * transport * depth**2
    return x2, 0.75 * transport * depth / jnp.sqrt(1 + x2)


def _depth_features(depth, co_albedo, g):
    x2, seen = _saturation(depth, co_albedo, g)
    features = [
        jnp.log((seen + 1e-3) / (1 + seen)) / 3 + 1,
        2 / (1 + seen) - 1,
        jnp.log((depth + 1e-2) / (depth + 3)) / 2 + 1,
        2 / (1 + x2) - 1,
    ]
    return features, (x2, seen)


def _slant_features(depth, co_albedo, g, cosine):
    slant = depth / cosine
    scaled = (1 - (1 - co_albedo) * g**2) * slant
    return [
        2 * cosine - 1,
        jnp.log(cosine) / 2 + 0.5,
        2 * jnp.exp(-slant) - 1,
        2 * jnp.exp(-scaled) - 1,
        jnp.log((slant + 0.03) / (slant + 30)) / 3 + 0.5,
    ]


def _pair_features(depth, co_albedo, phase, sun, view, scattering):
    """Features that are equal when sun and viewer are swapped, and a first guess."""
    g = _asymmetry(phase)
    twice = jnp.minimum(phase.forward, LARGEST_ASYMMETRY) ** 2
    features, (_, seen) = _depth_features(depth, co_albedo, g)
    albedo = 1 - co_albedo
    total, product = sun + view, sun * view
    slant = depth * total / product
    scaled = (1 - albedo * g**2) * slant
    features += [
        jnp.log(total),
        jnp.log(product) / 2 + 0.5,
        3 * product - 1,
        scattering + product,
        scattering,
        jnp.log(phase(scattering) + 1e-5) / 2,
        # Two passes of Henyey and Greenstein with g are one with g².
        jnp.log(1 + twice**2 - 2 * twice * scattering),
        2 * jnp.exp(-slant) - 1,
        2 * jnp.exp(-scaled) - 1,
        jnp.log((slant + 0.03) / (slant + 30)) / 3 + 0.5,
    ]
    # Of the second order in thin slabs, and reciprocal.
    scale = albedo**2 * seen / (1 + seen) * -jnp.expm1(-slant) / total
    return jnp.stack(features), scale


def _ratios(out, depth, co_albedo, saturation):
    """Absorbed to other light, and reflected to transmitted light.

    Both start from two streams, absorbed to other light as the length of the path,
    reflected to transmitted light as sinh(kτ)/k; the networks give what differs.
    """
    x2, seen = saturation
    growth = jnp.minimum(x2 / (1 + jnp.sqrt(1 + x2)), 25.0)
    log_turned, log_path = out
    turned = seen * jnp.exp(growth + log_turned)
    return co_albedo * depth / jnp.sqrt(1 + x2) * jnp.exp(log_path), turned


def _reflected_and_transmitted(lost, turned):
    kept = 1 / (1 + lost)
    return kept * turned / (1 + turned), kept / (1 + turned)


@ft.cache
def _arrays() -> dict[str, np.ndarray]:
    file = importlib.resources.files("cloudjax.light").joinpath("reflectance.npz")
    with file.open("rb") as stream, np.load(stream) as arrays:
        return dict(arrays)


def _network(name):
    fields = Network.__dataclass_fields__
    return Network(**{f: jnp.asarray(_arrays()[f"{name}.{f}"], float) for f in fields})
