"""Fits that stay as they are."""

from .scenes import numbers_of


def test_the_numbers_of_a_small_fit_stay(stored, example_of_a_fit):
    """The fit of the README: ten steps on the embedded scene."""
    found = numbers_of(example_of_a_fit.folder / "out" / "example" / "fit.json")
    stored.check("small_fit", *found)
