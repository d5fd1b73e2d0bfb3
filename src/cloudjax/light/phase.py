"""Phase functions of scattering depend on the cosine of the scattering angle.

All are normalised to a mean of 1 over the sphere; the cosine is 1 forwards.
"""

import abc

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float


class AbstractPhase(eqx.Module):
    """A phase function says how a particle shares out the light that it scatters."""

    @abc.abstractmethod
    def __call__(self, cosine: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """Return the phase function P, with ∫P dΩ = 4π."""

    @property
    @abc.abstractmethod
    def moments(self) -> Float[Array, "4"]:
        """Give the means of the Legendre polynomials of degrees 1 to 4."""

    @property
    @abc.abstractmethod
    def forward(self) -> Float[Array, ""]:
        """Give the asymmetry of the forward peak, which the high moments follow."""

    @property
    def asymmetry(self) -> Float[Array, ""]:
        """Give the mean cosine of the scattering angle."""
        return self.moments[0]


class HenyeyGreenstein(AbstractPhase):
    """This is that of Henyey & Greenstein (1941, Astrophys. J. 93, 70)."""

    parameter: Float[Array, ""]

    def __call__(self, cosine):
        return _henyey_greenstein(self.parameter, cosine)

    @property
    def moments(self):
        return jnp.stack(_powers(self.parameter)[1:5])

    @property
    def forward(self):
        return self.parameter


class DoubleHenyeyGreenstein(AbstractPhase):
    """Two such functions add up: a forward peak and a backward one, as clouds have in
    their glory.

    **Fields:** `ahead`, `behind`: asymmetry of each, the second negative; `share`: of
    the first.
    """

    ahead: Float[Array, ""]
    behind: Float[Array, ""]
    share: Float[Array, ""]

    def __call__(self, cosine):
        ahead = _henyey_greenstein(self.ahead, cosine)
        behind = _henyey_greenstein(self.behind, cosine)
        return self.share * ahead + (1 - self.share) * behind

    @property
    def moments(self):
        ahead = jnp.stack(_powers(self.ahead)[1:5])
        behind = jnp.stack(_powers(self.behind)[1:5])
        return self.share * ahead + (1 - self.share) * behind

    @property
    def forward(self):
        return self.ahead


class CornetteShanks(AbstractPhase):
    """This is the phase function of Cornette & Shanks (1992, Appl. Opt. 31, 3152),
    which is Rayleigh's for g = 0.

    **Fields:** `parameter`: their g, at most 0.06 below the asymmetry.
    """

    parameter: Float[Array, ""]

    def __call__(self, cosine):
        tilt = 1.5 * (1 + cosine**2) / (2 + self.parameter**2)
        return tilt * _henyey_greenstein(self.parameter, cosine)

    @property
    def moments(self):
        # Of x² P(x), by the recurrence of the Legendre polynomials used twice.
        χ = _powers(self.parameter)
        twice = _times_cosine(_times_cosine(χ))
        factor = 1.5 / (2 + self.parameter**2)
        return jnp.stack([factor * (χ[i] + twice[i]) for i in range(1, 5)])

    @property
    def forward(self):
        return self.parameter


def _henyey_greenstein(g, cosine):
    distance2 = 1 + g**2 - 2 * g * cosine
    return (1 - g**2) / (distance2 * jnp.sqrt(distance2))


def _powers(g):
    return [jnp.ones_like(g), g, g**2, g**3, g**4, g**5, g**6]


def _times_cosine(χ):
    """Moments of x P(x) from those of P, one fewer."""
    below = [jnp.zeros_like(χ[0]), *χ]
    return [
        ((i + 1) * χ[i + 1] + i * below[i]) / (2 * i + 1) for i in range(len(χ) - 1)
    ]
