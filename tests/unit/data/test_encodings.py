"""Any legal encoding of the same values reads alike, and what is none is refused."""

from dataclasses import replace

import netCDF4
import numpy as np
import pytest
import xarray as xr

from cloudjax_data import DataError, EmissiveCalibration, read_band
from tests.generated import DIALECT, window, write_abi_cmi, write_abi_l1b
from tests.mutations.netcdf_content import Content, changed


SHAPE = (6, 9)


def image(band: int) -> np.ndarray:
    """Radiances down to the noise below zero, with a gap."""
    dialect = DIALECT[band]
    highest = dialect.scale * (dialect.fill - 2) + dialect.offset
    values = np.linspace(dialect.offset, 0.4 * highest, SHAPE[0] * SHAPE[1])
    values[7] = np.nan
    return values.reshape(SHAPE)


def as_floats(content: Content, kind="f4", fill=np.nan) -> None:
    """What xarray writes once it has decoded a file."""
    held = content.variables["Rad"]
    counts = held.stored.astype(np.uint16)
    absent = counts == np.uint16(held.attributes["_FillValue"])
    scale, offset = held.attributes.pop("scale_factor"), held.attributes["add_offset"]
    del held.attributes["add_offset"], held.attributes["_Unsigned"]
    values = counts.astype(kind) * kind_of(scale, kind) + kind_of(offset, kind)
    held.stored = np.where(absent, fill, values).astype(kind)
    held.attributes["_FillValue"] = np.dtype(kind).type(fill)


def kind_of(value, kind):
    return np.dtype(kind).type(value)


def with_another_packing(content: Content) -> None:
    """Signed counts of another step and offset, as a tool chooses them."""
    as_floats(content, "f8")
    held = content.variables["Rad"]
    scale, offset = np.float64(0.002), np.float64(3.0)
    counts = np.round((np.nan_to_num(held.stored) - offset) / scale)
    held.stored = np.where(np.isnan(held.stored), -2_000_000_000, counts).astype("i4")
    held.attributes |= {
        "_FillValue": np.int32(-2_000_000_000),
        "scale_factor": scale,
        "add_offset": offset,
    }


def without_unsigned(content: Content) -> None:
    del content.variables["Rad"].attributes["_Unsigned"]


def as_unsigned(content: Content) -> None:
    held = content.variables["Rad"]
    del held.attributes["_Unsigned"]
    held.stored = held.stored.astype("u2")
    held.attributes["_FillValue"] = np.uint16(held.attributes["_FillValue"])
    held.attributes["valid_range"] = held.attributes["valid_range"].astype("u2")


def big_endian(content: Content) -> None:
    flags = content.variables["DQF"]
    flags.stored = flags.stored.astype("i2")
    flags.attributes = {"_FillValue": np.int16(-1)}
    for name in ("Rad", "DQF", "t", "band_wavelength"):
        held = content.variables[name]
        held.stored = held.stored.astype(held.stored.dtype.newbyteorder(">"))


def another_fill(content: Content) -> None:
    held = content.variables["Rad"]
    fill = held.attributes["_FillValue"]
    held.stored = np.where(held.stored == fill, np.int16(-7), held.stored)
    held.attributes["_FillValue"] = np.int16(-7)


def fill_by_range(content: Content) -> None:
    """The fill value is lost; what is beyond the valid range is none all the same."""
    del content.variables["Rad"].attributes["_FillValue"]


def missing_value(content: Content) -> None:
    held = content.variables["Rad"]
    held.attributes["missing_value"] = held.attributes.pop("_FillValue")
    del held.attributes["valid_range"]


def chunked(content: Content) -> None:
    options = {"zlib": True, "complevel": 9, "shuffle": True, "chunksizes": (4, 5)}
    content.variables["Rad"].options |= options


def transposed(content: Content) -> None:
    for name in ("Rad", "DQF"):
        held = content.variables[name]
        held.dimensions, held.stored = ("x", "y"), held.stored.T


def with_a_time(content: Content) -> None:
    content.dimensions["time"] = 1
    for name in ("Rad", "DQF"):
        held = content.variables[name]
        held.dimensions, held.stored = ("time", *held.dimensions), held.stored[None]


def from_the_south(content: Content) -> None:
    for name in ("Rad", "DQF", "y"):
        content.variables[name].stored = content.variables[name].stored[::-1]


def from_the_east(content: Content) -> None:
    for name in ("Rad", "DQF"):
        content.variables[name].stored = content.variables[name].stored[:, ::-1]
    content.variables["x"].stored = content.variables["x"].stored[::-1]


def in_metres(content: Content) -> None:
    for name in "xy":
        held = content.variables[name]
        scale, offset = held.attributes["scale_factor"], held.attributes["add_offset"]
        angles = held.stored * round(float(scale), 6) + round(float(offset), 6)
        held.stored = angles * 35786023.0
        held.attributes = {"units": "m"}


def flags_as_floats(content: Content) -> None:
    held = content.variables["DQF"]
    held.stored = np.where(held.stored == -1, np.nan, held.stored).astype("f4")
    held.attributes = {"_FillValue": np.float32(np.nan)}


ENCODINGS = [
    as_floats,
    lambda c: as_floats(c, "f8", -9999.0),
    with_another_packing,
    without_unsigned,
    as_unsigned,
    big_endian,
    another_fill,
    fill_by_range,
    missing_value,
    chunked,
    transposed,
    with_a_time,
    from_the_south,
    from_the_east,
    in_metres,
    flags_as_floats,
]


@pytest.mark.parametrize("number", [2, 7, 13])
@pytest.mark.parametrize("encode", ENCODINGS, ids=lambda f: f.__name__)
def test_encodings_read_alike(tmp_path, number, encode):
    dqf = np.where(np.isnan(image(number)), 3, 0)
    dqf[2, 3], dqf[4, 4] = 1, 255
    path = write_abi_l1b(tmp_path, band=number, radiance=image(number), dqf=dqf)
    plain = read_band(path)
    other = read_band(changed(path, encode))
    np.testing.assert_array_equal(other.good, plain.good)
    np.testing.assert_array_equal(plain.good, dqf == 0)
    step = 0.002 if encode is with_another_packing else 1e-6
    np.testing.assert_allclose(other.radiance, plain.radiance, atol=step, rtol=1e-6)
    np.testing.assert_allclose(other.grid.x_rad, plain.grid.x_rad, atol=1e-12)
    np.testing.assert_allclose(other.grid.y_rad, plain.grid.y_rad, atol=1e-12)
    assert other.calibration == plain.calibration
    assert not other.notes


def test_temperatures_do_not_depend_on_the_packing(tmp_path):
    """As the file's own count above zero has it, by plain netCDF4 and Planck's law."""
    path = write_abi_l1b(tmp_path, band=7, radiance=image(7))
    with netCDF4.Dataset(path) as file:
        seen = np.ma.filled(file["Rad"][...].astype(float), np.nan)
        fk1, fk2, bc1, bc2 = (
            float(file[f"planck_{key}"][...]) for key in ("fk1", "fk2", "bc1", "bc2")
        )
    least = seen[seen > 0].min()
    # 0.0376 is 24.04 counts of 0.00156.
    least = min(least, 25 * 0.001564351 - 0.0376)
    expected = (fk2 / np.log(fk1 / np.maximum(seen, least) + 1) - bc1) / bc2
    for encode in (lambda c: None, as_floats, with_another_packing):
        path = write_abi_l1b(tmp_path, band=7, radiance=image(7))
        band = read_band(changed(path, encode))
        assert isinstance(band.calibration, EmissiveCalibration)
        kelvin = band.calibration.brightness_temperature_k(band.radiance)
        bright = seen > 0.05
        np.testing.assert_allclose(kelvin[bright], expected[bright], atol=0.2)
        dark = seen < 0
        np.testing.assert_allclose(kelvin[dark], expected[dark], atol=0.05)


def test_a_copy_of_xarray_reads_alike(tmp_path):
    path = write_abi_l1b(tmp_path, band=7, radiance=image(7))
    plain = read_band(path)
    with xr.open_dataset(path) as decoded:
        decoded.drop_encoding().to_netcdf(tmp_path / "copy.nc")
    copy = read_band(tmp_path / "copy.nc")
    np.testing.assert_allclose(copy.radiance, plain.radiance, rtol=1e-6, atol=1e-6)
    assert copy.calibration == plain.calibration
    assert (copy.start, copy.end) == (plain.start, plain.end)


@pytest.mark.parametrize("name", ["Rad", "DQF"])
def test_images_of_other_shapes_are_refused(tmp_path, name):
    def shorten(content):
        content.dimensions["short"] = 4
        held = content.variables[name]
        held.dimensions, held.stored = ("short", "x"), held.stored[:4]

    path = write_abi_l1b(tmp_path, band=13, radiance=image(13))
    with pytest.raises(DataError, match="make no single image on y and x"):
        read_band(changed(path, shorten))


def test_flags_without_unsigned_or_fill_let_nothing_through(tmp_path):
    """255 is -1 then, which is no quality at all."""

    def bare(content):
        content.variables["DQF"].attributes.clear()

    dqf = np.full(SHAPE, 255)
    dqf[0] = 0
    path = write_abi_l1b(tmp_path, band=13, radiance=np.full(SHAPE, 60.0), dqf=dqf)
    band = read_band(changed(path, bare), keep_conditionally_usable=True)
    np.testing.assert_array_equal(band.good, dqf == 0)


@pytest.mark.parametrize(
    ("attribute", "value", "said"),
    [
        ("scale_factor", np.float32(0), "scale of 0"),
        ("scale_factor", np.float32(np.nan), "which is no number"),
        ("scale_factor", "0.05", "which is no number"),
        ("scale_factor", np.float32(40.0), "no radiance of band 13"),
        ("add_offset", np.array([1, 2], "f4"), "which is no number"),
        ("add_offset", np.float32(5000.0), "which is not ABI's"),
        ("units", "W m-2 sr-1 um-1", "in 'W m-2 sr-1 um-1' and not in"),
    ],
)
def test_packings_that_are_none_are_refused(tmp_path, attribute, value, said):
    def spoil(content):
        content.variables["Rad"].attributes[attribute] = value

    path = write_abi_l1b(tmp_path, band=13, radiance=np.full(SHAPE, 60.0))
    with pytest.raises(DataError, match=said):
        read_band(changed(path, spoil))


def test_a_few_impossible_radiances_are_left_out_and_told(tmp_path):
    """Of a float file, whose fill value is not named."""

    def unnamed(content):
        as_floats(content, "f4", -32768.0)
        del content.variables["Rad"].attributes["_FillValue"]
        content.variables["DQF"].stored[...] = 0

    path = write_abi_l1b(tmp_path, band=13, radiance=image(13))
    band = read_band(changed(path, unnamed))
    np.testing.assert_array_equal(band.good, np.isfinite(image(13)))
    assert "1 pixels of a radiance that no scene has" in band.notes[0]


def test_celsius_is_not_taken_for_kelvin(tmp_path):
    def celsius(content):
        held = content.variables["CMI"]
        held.attributes["add_offset"] -= np.float32(273.15)

    radiance = {13: np.full(SHAPE, 60.0)}
    path = write_abi_cmi(tmp_path, radiance=radiance)
    with pytest.raises(DataError, match="packing or its units"):
        read_band(changed(path, celsius))


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("sweep_angle_axis", "y", "ABI sweeps 'x'"),
        ("perspective_point_height", 35.7e6, "a height of"),
        ("semi_major_axis", 6371000.0, "a semi-major axis of"),
        ("longitude_of_projection_origin", "west", "which is no number"),
        ("longitude_of_projection_origin", 400.0, "over longitude 400"),
    ],
)
def test_projections_that_are_not_those_of_abi_are_refused(tmp_path, name, value, said):
    def spoil(content):
        content.variables["goes_imager_projection"].attributes[name] = value

    path = write_abi_l1b(tmp_path, band=13, radiance=np.full(SHAPE, 60.0))
    with pytest.raises(DataError, match=said):
        read_band(changed(path, spoil))


def test_longitudes_are_of_either_count(tmp_path):
    def eastward(content):
        attributes = content.variables["goes_imager_projection"].attributes
        attributes["longitude_of_projection_origin"] = 223.0

    path = write_abi_l1b(tmp_path, band=13, radiance=np.full(SHAPE, 60.0))
    plain = read_band(path).grid
    assert read_band(changed(path, eastward)).grid.same_as(plain)


def test_uneven_scan_angles_are_refused(tmp_path):
    def gap(content):
        content.variables["x"].stored[4:] += 3

    grid = replace(window(SHAPE))
    path = write_abi_l1b(tmp_path, band=13, radiance=np.full(SHAPE, 60.0), grid=grid)
    with pytest.raises(DataError, match="scan angles 'x' that are missing, uneven"):
        read_band(changed(path, gap))
