"""Decoding of packed integers."""

import netCDF4
import numpy as np
import pytest

from cloudjax_data.packed import counts


@pytest.mark.parametrize(
    ("flag", "stored", "fill", "expected"),
    [
        ("true", [-1, -25536, 5], -1, [65535, 40000, 5]),
        ("false", [-1, -25536, 5], -1, [-1, -25536, 5]),
        (None, [-1, 7, 5], 7, [-1, 7, 5]),
    ],
)
def test_unsigned_before_fill(tmp_path, flag, stored, fill, expected):
    with netCDF4.Dataset(tmp_path / "packed.nc", "w") as file:
        file.createDimension("x", 3)
        packed = file.createVariable("v", "i2", ("x",), fill_value=fill)
        packed.set_auto_maskandscale(False)
        if flag is not None:
            packed.setncattr("_Unsigned", flag)
        packed[:] = np.array(stored, np.int16)
        values, valid = counts(packed)
    np.testing.assert_array_equal(values, expected)
    np.testing.assert_array_equal(valid, np.array(stored) != fill)
