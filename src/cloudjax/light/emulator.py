"""Small neural networks have weights that depend on the material.

What a cloud's particles are is the same for all rays of a band, where they are lit and
seen from is not. A first network turns the material into the weights of a second, which
therefore can be small: it is the only one that is evaluated for every ray.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float


class Network(eqx.Module):
    """A `Network` has two hidden layers, whose weights are mixed by two hidden layers.

    All weights of the second network are sums over `mixtures` of stored weights; the
    first mixture has the factor 1, the others what the first network says.
    """

    mixer_weight_1: Float[Array, "wide material"]
    mixer_bias_1: Float[Array, " wide"]
    mixer_weight_2: Float[Array, "wide wide"]
    mixer_bias_2: Float[Array, " wide"]
    mixer_weight_3: Float[Array, "mixed wide"]
    mixer_bias_3: Float[Array, " mixed"]
    weight_1: Float[Array, "mixtures width features"]
    bias_1: Float[Array, "mixtures width"]
    weight_2: Float[Array, "mixtures width width"]
    bias_2: Float[Array, "mixtures width"]
    weight_3: Float[Array, "mixtures outputs width"]
    weight_skip: Float[Array, "mixtures outputs features"]
    bias_3: Float[Array, "mixtures outputs"]

    def __call__(
        self,
        material: Float[Array, " material"],
        features: Float[Array, "features *n"],
    ) -> Float[Array, "outputs *n"]:
        """Evaluate the network; for bounded features the outputs are bounded, however
        far from where it was trained.
        """
        x = soft_sign(self.mixer_weight_1 @ material + self.mixer_bias_1)
        x = soft_sign(self.mixer_weight_2 @ x + self.mixer_bias_2)
        x = self.mixer_weight_3 @ x + self.mixer_bias_3
        mixture = jnp.concatenate([jnp.ones(1), x])

        def mixed(weights):
            return jnp.tensordot(mixture, weights, 1)

        flat = features.reshape(features.shape[0], -1)
        x = soft_sign(mixed(self.weight_1) @ flat + mixed(self.bias_1)[:, None])
        x = soft_sign(mixed(self.weight_2) @ x + mixed(self.bias_2)[:, None])
        x = mixed(self.weight_3) @ x + mixed(self.weight_skip) @ flat
        x = x + mixed(self.bias_3)[:, None]
        return x.reshape(-1, *features.shape[1:])


def soft_sign(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Return x/√(1 + x²), which is smooth and bounded, and half the price of tanh."""
    return x / jnp.sqrt(1 + x**2)
