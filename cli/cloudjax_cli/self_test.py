"""A self-test of compiled derivatives, which one release of jax gets wrong."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


# Of central differences: balances truncation and rounding for float32 values near 1.
_STEP = 1e-2
# What is compared are numbers of size 0.1 to 1. Miscompiled, they differ by 0.6;
# float32 leaves 3e-7 between the two modes, and central differences 2e-4.
_BETWEEN_MODES = 1e-4
_FROM_DIFFERENCES = 5e-3


def derivative_error() -> str | None:
    """What is wrong with jit(jacfwd) on this machine, in a sentence, or None.

    The function is eq. (1) written as a product with a weight vector, at a size at
    which jax 0.10.2 returns wrong Jacobians on CPU in float32 without a warning. The
    renderer avoids this form; but a jax that fails here is not to be trusted.
    """
    samples = np.random.default_rng(0).random((2500, 32, 3), dtype=np.float32)
    at = jnp.asarray([0.5, 0.4, 0.52, -1.2, 0.1], jnp.float32)

    def function(v):
        return _march(jnp.asarray(samples), v)

    forward = np.asarray(jax.jit(jax.jacfwd(function))(at))
    reverse = np.asarray(jax.jit(jax.jacrev(function))(at))
    difference = _central_differences(jax.jit(function), at)
    return _verdict(
        float(np.abs(forward - reverse).max()),
        float(np.abs(forward - difference).max()),
    )


def _verdict(between_modes: float, from_differences: float) -> str | None:
    # Not "greater than": a NaN is wrong too.
    if between_modes < _BETWEEN_MODES and from_differences < _FROM_DIFFERENCES:
        return None
    return (
        f"jax {jax.__version__} miscompiles derivatives on {jax.default_backend()} "
        f"(forward and reverse mode differ by {between_modes:.2g}, forward mode and "
        f'central differences by {from_differences:.2g}): run pip install "jax>=0.9,'
        '!=0.10.2".'
    )


def _march(
    samples: Float[Array, "rays steps textures"], v: Float[Array, "5"]
) -> Float[Array, "2"]:
    """Mean reflectance and emission of a toy cloud."""
    distance = (jnp.arange(32, dtype=jnp.float32) + 0.5) * 4.0
    first, second, third = jnp.eye(3, dtype=jnp.float32)
    weights = first + second * v[0] - third * v[1]
    barriers = jnp.exp(-distance / 12.8) + jnp.exp((distance - 128) / 12.8)
    cloud = (samples * weights[None, None, :]).sum(-1) - barriers[None, :]
    density = jax.nn.sigmoid((cloud - v[2]) / 0.02) * 4.0
    extinction, passed = jnp.exp(v[3]), jnp.cumsum(density, 1)
    after = jnp.exp(-extinction * passed)
    before = jnp.exp(-extinction * (passed - density))
    depth = 0.075 * extinction * passed[:, -1]
    emission = 1 - 0.5 * jnp.exp(v[4]) * distance / 128
    emitted = ((before - after) * emission[None, :]).sum(1)
    return jnp.stack([(depth / (1 + depth)).mean(), (after[:, -1] + emitted).mean()])


def _central_differences(function, at: Float[Array, "5"]) -> Float[np.ndarray, "2 5"]:
    columns = []
    for i in range(len(at)):
        step = jnp.zeros_like(at).at[i].set(_STEP)
        change = np.asarray(function(at + step)) - np.asarray(function(at - step))
        columns.append(change / (2 * _STEP))
    return np.stack(columns, axis=1)
