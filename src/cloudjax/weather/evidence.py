"""What an analysis tells of cloud amount becomes a fraction of each class.

Covers of layers come from the analysis itself where it has them. Elsewhere they follow
from its condensate (Xu & Randall 1996) or from humidity, vertical motion and stability
(Slingo 1987). Classes share the cover of their layer.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from cloudjax.geometry.latlon_grid import AnyArray


LAYERS = ("low", "middle", "high")
# Fields that a class may ask for, and their units.
QUANTITIES = {
    "inversion_k": "estimated inversion strength, K",
    "boundary_layer_share": "of low cloud, the part in the boundary layer, 0 to 1",
    "tropopause_m": "its height, m",
    "ascent_pa_s": "upward motion at the altitude of sampling, Pa/s",
    "deep_convection": "fraction of the sky under deep convective cloud, 0 to 1",
}
# Of clear sky: how much a full cover leaves to be shared.
_LEAST_CLEAR = 1e-3
# Of a share: classes that no condition suits still divide among themselves.
_LEAST_WEIGHT = 1e-6


@dataclass(frozen=True)
class Window:
    """A `Window` is a condition with soft edges on a quantity of the analysis.

    **Fields:**

    - `quantity`: one of `QUANTITIES`.
    - `above`, `below`: its interval; the ends may be infinite.
    - `width`: scale s of the logistic edges 1/(1 + exp(-(x - edge)/s)).
    """

    quantity: str
    above: float = -float("inf")
    below: float = float("inf")
    width: float = 1.0

    def __post_init__(self):
        if self.quantity not in QUANTITIES:
            raise ValueError(
                f"There is no quantity {self.quantity!r}: the quantities are "
                f"{', '.join(QUANTITIES)}."
            )
        if not self.above < self.below:
            raise ValueError(f"above must be less than below, of {self.quantity}.")
        if not self.width > 0:
            raise ValueError(f"width must be positive, of {self.quantity}.")

    def __call__(self, value: Float[AnyArray, "*n"]) -> Float[Array, "*n"]:
        """Return the soft indicator, 0 to 1."""
        x = jnp.asarray(value)
        rising = jax.nn.sigmoid((x - self.above) / self.width)
        return rising * jax.nn.sigmoid((self.below - x) / self.width)


@dataclass(frozen=True)
class Evidence:
    """`Evidence` says which part of the cloud of an analysis a class is.

    **Fields:**

    - `layer`: "low", "middle" or "high".
    - `claims`: the quantity that is the class's own fraction of the sky, within the
      cover of its layer; empty for a share of what is left.
    - `windows`: conditions that multiply its share.
    """

    layer: str
    claims: str = ""
    windows: tuple[Window, ...] = ()

    def __post_init__(self):
        if self.layer not in LAYERS:
            raise ValueError(f"layer must be one of {', '.join(LAYERS)}.")
        if self.claims and self.claims not in QUANTITIES:
            raise ValueError(
                f"There is no quantity {self.claims!r} to claim: the quantities are "
                f"{', '.join(QUANTITIES)}."
            )

    @property
    def quantities(self) -> frozenset[str]:
        """List all that it asks for."""
        asked = {window.quantity for window in self.windows}
        return frozenset(asked | ({self.claims} if self.claims else set()))

    def weight(
        self, quantities: Mapping[str, Float[AnyArray, "*n"]]
    ) -> Float[Array, "*#n"]:
        """Return how well the class suits a place, 0 to 1."""
        found = jnp.ones(())
        for window in self.windows:
            found = found * window(quantities[window.quantity])
        return found


def shared(
    cover: Float[AnyArray, "*n"], weights: Sequence[Float[AnyArray, "*#n"]]
) -> list[Float[Array, "*n"]]:
    """Divide the cover of a layer among classes whose clouds are independent.

    Independent clouds leave clear what each leaves clear, Π (1 - f_i). With the shares
    s_i = weight over the sum of weights, f_i = 1 - (1 - cover)^s_i makes that 1 - cover
    exactly. A full cover leaves a thousandth clear, so that small shares stay small.
    """
    weights = [jnp.maximum(jnp.asarray(w), _LEAST_WEIGHT) for w in weights]
    total = sum(weights, jnp.zeros(()))
    clear = jnp.clip(1 - jnp.asarray(cover), _LEAST_CLEAR, 1.0)
    return [-jnp.expm1(w / total * jnp.log(clear)) for w in weights]


def left_by(
    cover: Float[AnyArray, "*n"], claimed: Float[AnyArray, "*n"]
) -> Float[Array, "*n"]:
    """Return the cover that other clouds need, independent of those that have claimed
    a part, for both together to make the cover.
    """
    cover, claimed = jnp.asarray(cover), jnp.asarray(claimed)
    open_sky = jnp.maximum(1 - claimed, _LEAST_CLEAR)
    return jnp.clip((cover - claimed) / open_sky, 0.0, 1.0)


def condensate_cover(
    relative_humidity: Float[AnyArray, "*n"],
    saturation: Float[AnyArray, "*n"],
    condensate: Float[AnyArray, "*n"],
) -> Float[Array, "*n"]:
    """Return the cloud fraction that goes with condensate: Xu & Randall (1996, J.
    Atmos. Sci. 53, 3084), C = RH^¼ (1 - exp(-100 q_c / ((1 - RH) q_s)^0.49)).

    **Arguments:** `relative_humidity`: 0 to 1; `saturation`, `condensate`: specific
    humidity at saturation, mass of water and ice [kg/kg].
    """
    humidity = jnp.clip(jnp.asarray(relative_humidity), 1e-3, 0.999)
    lacking = jnp.maximum((1 - humidity) * jnp.asarray(saturation), 1e-9)
    amount = 100 * jnp.maximum(jnp.asarray(condensate), 0) / lacking**0.49
    return humidity**0.25 * -jnp.expm1(-amount)


def humidity_cover(
    relative_humidity: Float[AnyArray, "*n"], critical: float = 0.8
) -> Float[Array, "*n"]:
    """Return ((RH - RH_c)/(1 - RH_c))² above the critical humidity: Slingo (1987, Q. J.
    R. Meteorol. Soc. 113, 899).
    """
    excess = (jnp.asarray(relative_humidity) - critical) / (1 - critical)
    return jnp.clip(excess, 0.0, 1.0) ** 2


def ascent_factor(omega_pa_s: Float[AnyArray, "*n"]) -> Float[Array, "*n"]:
    """Return the factor of Slingo (1987) on low cloud: 0 where air sinks, 1 where it
    rises by 0.1 Pa/s and more.
    """
    return jnp.clip(-jnp.asarray(omega_pa_s) / 0.1, 0.0, 1.0)


def inversion_cover(
    stability_k_hpa: Float[AnyArray, "*n"], relative_humidity: Float[AnyArray, "*n"]
) -> Float[Array, "*n"]:
    """Return the cover of cloud below an inversion: Slingo (1987),
    -6.67 dθ/dp - 0.667, less where its base is drier than 80 %, none below 60 %.

    **Arguments:** `stability_k_hpa`: -dθ/dp of the most stable layer.
    """
    moist = jnp.clip((jnp.asarray(relative_humidity) - 0.6) / 0.2, 0.0, 1.0)
    return moist * jnp.clip(6.67 * jnp.asarray(stability_k_hpa) - 0.667, 0.0, 1.0)
