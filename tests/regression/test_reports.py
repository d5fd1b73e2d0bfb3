"""Comparisons that stay as they are."""

from .scenes import comparison
from .stored import share


def test_the_numbers_of_a_comparison_stay(stored, tmp_path):
    """Allowed: 1e-6, for they are sums in float64 of what files hold in integers."""
    found = comparison(tmp_path)
    stored.check("comparison", found, share(found, 1e-6))
