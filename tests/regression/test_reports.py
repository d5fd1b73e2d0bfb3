"""Comparisons that stay as they are."""

from .scenes import comparison


def test_the_numbers_of_a_comparison_stay(stored, tmp_path):
    stored.check("comparison", *comparison(tmp_path))
