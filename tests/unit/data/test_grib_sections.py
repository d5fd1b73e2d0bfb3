"""Messages of GRIB whose sections or packed values contradict themselves.

eccodes frees memory twice, or aborts, over some of them: the reader must refuse before
it asks eccodes.
"""

import itertools as it
import struct
import zlib

import numpy as np
import pytest

from cloudjax_data import DataError
from cloudjax_data.grib import read_grib
from cloudjax_data.grib_messages import message_offsets
from tests.generated_grib import write_grib
from tests.mutations.grib_bases import sections


RNG = np.random.default_rng(4)
FIELDS = {
    ("u", 500): RNG.uniform(5, 9, (5, 12)),
    ("t", 500): np.where(np.arange(12) < 6, 250, RNG.uniform(250, 260, (5, 12))),
}
HOLES = {key: np.where(np.arange(12) // 4 == 1, np.nan, v) for key, v in FIELDS.items()}
WANTED = [("isobaricInhPa", name) for name in "ut"]


def write(path, edition=2, fields=FIELDS, packing="grid_simple"):
    return write_grib(
        path,
        fields,
        latitude_deg=np.arange(60.0, -61.0, -30.0),
        longitude_deg=np.arange(0.0, 360.0, 30.0),
        edition=edition,
        extra={"packingType": packing},
    )


def messages(path):
    content = path.read_bytes()
    starts = [*message_offsets(path), len(content)]
    return [content[i:j] for i, j in it.pairwise(starts)]


def spoil(path, section, at, change):
    """Change bytes of a section of the temperature, counted from its start."""
    wind, temperature = messages(path)
    start = {number: start for number, start, _ in sections(temperature)}[section]
    new = change if isinstance(change, bytes) else bytes([change])
    message = bytearray(temperature)
    message[start + at : start + at + len(new)] = new
    path.write_bytes(wind + message)


def read(path):
    return [field.values[::-1] for field in read_grib(path, WANTED).fields]


# -- sections


@pytest.mark.parametrize("new", [b"\x08\0\0\x15", b"\0\0\0\0", b"\0\0\0\x16"])
@pytest.mark.parametrize("section", [1, 3, 4, 5, 6, 7])
def test_lengths_of_sections_must_fill_a_message(tmp_path, section, new):
    """With the first of these eccodes ends the program: it frees memory twice."""
    path = write(tmp_path / "w.grib")
    spoil(path, section, 0, new)
    with pytest.raises(DataError, match=r"sections of its message 2, .* do not fit"):
        read(path)


def test_a_message_must_end_with_data(tmp_path):
    """Without its last section, and with the length that it then has."""
    path = write(tmp_path / "w.grib")
    wind, temperature = messages(path)
    ((_, start, _),) = (part for part in sections(temperature) if part[0] == 7)
    total = (start + 4).to_bytes(8)
    path.write_bytes(wind + temperature[:8] + total + temperature[16:start] + b"7777")
    with pytest.raises(DataError, match="sections of its message 2"):
        read(path)


@pytest.mark.parametrize("new", [0, 2, 5, 8, 255])
def test_numbers_of_sections_must_be_in_order(tmp_path, new):
    path = write(tmp_path / "w.grib")
    spoil(path, 4, 4, new)
    with pytest.raises(DataError, match="sections of its message 2"):
        read(path)


@pytest.mark.parametrize(
    ("section", "at", "new"),
    [
        (1, 0, b"\x08\0\x1c"),
        (1, 0, b"\0\0\0"),
        # neither grid nor bitmap, and both
        (1, 7, 0),
        (1, 7, 0xC0),
        (2, 0, b"\0\0\x21"),
        (4, 0, b"\0\0\x0b"),
        (4, 0, b"\xff\xff\xff"),
    ],
)
def test_sections_of_edition_1_must_fill_a_message(tmp_path, section, at, new):
    path = write(tmp_path / "w.grib", edition=1)
    spoil(path, section, at, new)
    with pytest.raises(DataError, match="sections of its message 2"):
        read(path)


def test_fields_that_share_a_message_are_read(tmp_path):
    """NCEP writes both winds of a level into one."""
    path = write(tmp_path / "w.grib")
    wind, temperature = messages(path)
    field = {number: start for number, start, _ in sections(temperature)}[4]
    both = wind[:-4] + temperature[field:]
    path.write_bytes(both[:8] + len(both).to_bytes(8) + both[16:])
    assert len(message_offsets(path)) == 1
    np.testing.assert_allclose(read(path), list(FIELDS.values()), rtol=1e-5)


def test_a_long_message_of_edition_1_is_counted_in_units(tmp_path):
    """Its data section then says how many bytes of the last unit are no message's."""
    path = write(tmp_path / "w.grib", edition=1)
    wind, temperature = messages(path)
    *_, (_, data, _) = sections(temperature)
    message = bytearray(temperature[:-4] + bytes(-len(temperature) % 120) + b"7777")
    message[4:7] = (0x800000 + len(message) // 120).to_bytes(3)
    message[data : data + 3] = len(b"7777").to_bytes(3)
    path.write_bytes(message + wind)
    assert message_offsets(path) == (0, len(message))


@pytest.mark.parametrize(("padding", "reads"), [(bytes(6), True), (b"value", False)])
def test_edition_1_may_pad_its_messages_with_zeros(tmp_path, padding, reads):
    path = write(tmp_path / "w.grib", edition=1)
    wind, temperature = messages(path)
    message = temperature[:-4] + padding + b"7777"
    path.write_bytes(wind + message[:4] + len(message).to_bytes(3) + message[7:])
    if reads:
        np.testing.assert_allclose(read(path), list(FIELDS.values()), rtol=1e-5)
        return
    with pytest.raises(DataError, match="sections of its message 2"):
        read(path)


# -- packed values


@pytest.mark.parametrize("fields", [FIELDS, HOLES], ids=["whole", "holes"])
@pytest.mark.parametrize(
    ("edition", "packing"),
    [
        *it.product((1, 2), ("grid_simple", "grid_ieee", "grid_ccsds", "grid_jpeg")),
        (2, "grid_complex"),
        (2, "grid_complex_spatial_differencing"),
        (1, "grid_second_order"),
    ],
)
def test_each_packing_holds_what_it_says(tmp_path, edition, packing, fields):
    path = write(tmp_path / "w.grib", edition, fields, packing)
    np.testing.assert_allclose(read(path), list(fields.values()), rtol=1e-5)


@pytest.mark.parametrize(
    ("packing", "section", "at", "new"),
    [
        # counts of values: eccodes asks for 34 gigabytes over the first
        ("grid_simple", 5, 5, b"\xff\0\0\x3c"),
        ("grid_ccsds", 5, 5, b"\xff\0\0\x3c"),
        ("grid_simple", 5, 5, b"\0\0\0\x3b"),
        # bits of a value, also fewer, which give other values
        ("grid_simple", 5, 19, 25),
        ("grid_simple", 5, 19, 12),
        ("grid_simple", 5, 19, 255),
        ("grid_ieee", 5, 11, 2),
        ("grid_complex", 5, 19, 60),
        # groups: their number, widths and lengths
        ("grid_complex", 5, 31, b"\0\1\0\0"),
        ("grid_complex", 5, 35, 90),
        ("grid_complex", 5, 36, 70),
        ("grid_complex", 5, 37, b"\0\0\0\x77"),
        ("grid_complex", 5, 42, b"\0\0\1\0"),
        ("grid_complex", 5, 46, 77),
        # sizes of images
        ("grid_jpeg", 7, 15, 1),
        ("grid_jpeg", 7, 46, 3),
        # order of differences and the bytes of the first values
        ("grid_complex_spatial_differencing", 5, 47, 7),
        ("grid_complex_spatial_differencing", 5, 48, 203),
    ],
)
def test_values_must_fill_their_message(tmp_path, packing, section, at, new):
    path = write(tmp_path / "w.grib", packing=packing)
    spoil(path, section, at, new)
    with pytest.raises(DataError, match="values of 't' at level 500 do not fill"):
        read(path)


@pytest.mark.parametrize("edition", [1, 2])
def test_a_bitmap_must_mark_as_many_points_as_there_are_values(tmp_path, edition):
    path = write(tmp_path / "w.grib", edition, fields=HOLES)
    spoil(path, {1: 3, 2: 6}[edition], 6, 0)
    with pytest.raises(DataError, match="values of 't' at level 500 do not fill"):
        read(path)


@pytest.mark.parametrize("bits", [12, 25, 255])
def test_bits_of_edition_1_must_fill_their_message(tmp_path, bits):
    path = write(tmp_path / "w.grib", edition=1)
    spoil(path, 4, 10, bits)
    with pytest.raises(DataError, match="values of 't' at level 500 do not fill"):
        read(path)


@pytest.mark.parametrize(
    ("columns", "rows", "colours", "reads"),
    [(12, 5, 0, True), (12, 6, 0, False), (13, 5, 0, False), (12, 5, 3, False)],
)
def test_an_image_of_png_must_have_the_size_of_the_grid(
    tmp_path, columns, rows, colours, reads
):
    path = write(tmp_path / "w.grib")
    (message, _) = messages(path)
    at = {number: start for number, start, _ in sections(message)}
    packing = bytearray(message[at[5] : at[6]])
    packing[9:11], packing[19] = (41).to_bytes(2), 16
    # With no scale: the value is the reference, and the whole number of the pixel.
    packing[11:19] = struct.pack(">fHH", 5.0, 0, 0)
    data = _png(columns, rows, colours)
    parts = [packing, message[at[6] : at[7]], (len(data) + 5).to_bytes(4), b"\7", data]
    spoilt = b"".join([message[: at[5]], *parts, b"7777"])
    path.write_bytes(spoilt[:8] + len(spoilt).to_bytes(8) + spoilt[16:])
    if reads:
        np.testing.assert_allclose(read(path)[0].ravel(), 5 + np.arange(60), atol=1e-4)
        return
    with pytest.raises(DataError, match="values of 'u' at level 500 do not fill"):
        read(path)


def _png(columns, rows, colours):
    """An image of 0, 1, 2 ... in 16 bits, row by row."""
    lines = np.arange(columns * rows, dtype=">u2").reshape(rows, columns)
    head = struct.pack(">IIBBBBB", columns, rows, 16, colours, 0, 0, 0)
    packed = zlib.compress(b"".join(b"\0" + line.tobytes() for line in lines))
    chunks = (b"IHDR", head), (b"IDAT", packed), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        len(content).to_bytes(4)
        + kind
        + content
        + zlib.crc32(kind + content).to_bytes(4)
        for kind, content in chunks
    )
