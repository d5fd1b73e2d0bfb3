"""Fits that stay as they are."""

from .scenes import numbers_of


def test_the_first_steps_of_a_small_fit_stay(stored, example_of_a_fit):
    """The fit of the README: its start and two steps on the embedded scene."""
    found = numbers_of(example_of_a_fit.folder / "out" / "example" / "fit.json")
    stored.check("small_fit", *found)
