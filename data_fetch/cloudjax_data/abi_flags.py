"""The quality flags of an ABI product tell in words what they mean."""

from dataclasses import dataclass

import netCDF4
import numpy as np
from jaxtyping import Bool, Shaped

from .errors import DataError
from .image_plane import image_plane
from .packed import attribute


@dataclass(frozen=True, eq=False)
class AbiFlags:
    """`AbiFlags` are the flags of an image, and what they mean.

    **Fields:**

    - `stored`: the numbers.
    - `valid`: where there are some.
    - `meanings`: of each meaning its mask, its value under the mask, and its words.
    """

    stored: Shaped[np.ndarray, "y x"]
    valid: Bool[np.ndarray, "y x"]
    meanings: tuple[tuple[int, int, str], ...]

    def say(self, word: str) -> Bool[np.ndarray, "y x"]:
        """Tell where one of the meanings that hold has this word in it."""
        found = np.zeros(self.stored.shape, bool)
        for mask, value, words in self.meanings:
            if word in words.split("_"):
                found |= self.valid & ((self.stored & mask) == value)
        return found

    @property
    def usable(self) -> Bool[np.ndarray, "y x"]:
        """Tell where all of the flag is explained, and none of it called invalid."""
        found = self.valid & ~self.say("invalid")
        for part in {mask for mask, _, _ in self.meanings}:
            values = [value for mask, value, _ in self.meanings if mask == part]
            found &= np.isin(self.stored & part, values)
        return found


def read_flags(file: netCDF4.Dataset, name: str) -> AbiFlags:
    """Read flags with the attributes that explain them.

    **Raises:** `DataError` if they are no whole numbers, or nothing explains them.
    """
    plane = image_plane(file, name)
    stored, valid = plane.counts((slice(None), slice(None)))
    words = str(attribute(plane.variable, "flag_meanings")).split()
    values = np.atleast_1d(attribute(plane.variable, "flag_values"))
    all_bits = np.full(len(values), -1)
    masks = np.atleast_1d(getattr(plane.variable, "flag_masks", all_bits))
    if stored.dtype.kind not in "iu" or not len(words) == len(values) == len(masks):
        raise DataError(
            f"{file.filepath()} does not explain its quality flags {name!r}: download "
            "it again."
        )
    meanings = zip(masks.astype(int), values.astype(int), words, strict=True)
    return AbiFlags(
        stored.astype(int), valid, tuple((int(m), int(v), w) for m, v, w in meanings)
    )
