"""Numbers of results, as JSON files have them."""

from typing import Any

from .histogram import Distances
from .uncertainty import Estimate


def distance_numbers(distances: Distances, when: str) -> dict[str, float]:
    """Return distances under names that end with when they are of."""
    return {
        f"w1_{when}": distances.w1,
        f"w1_{when}_over_std": distances.w1_over_std,
        f"ks_{when}": distances.ks,
        f"bias_{when}": distances.bias,
    }


def estimate_numbers(estimate: Estimate) -> dict[str, Any]:
    """Return all that is known of a fitted parameter."""
    parameter = estimate.parameter
    return {
        "value": estimate.value,
        "std": estimate.std,
        "determined": estimate.determined,
        "at_bound": estimate.at_bound,
        "start": estimate.start,
        "unit": parameter.unit,
        "lower": parameter.lower,
        "upper": parameter.upper,
        "prior": {
            "default": parameter.default,
            "spread": parameter.spread,
            "log": parameter.log,
        },
    }
