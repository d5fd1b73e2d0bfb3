"""Reading a part of an image against reading all of it."""

import tracemalloc

import netCDF4
import numpy as np
import pytest

from cloudjax_data import AbiScene, DataError, image_part, read_band
from tests.generated import window, write_abi_cmi, write_abi_l1b


SHAPE = (24, 36)


@pytest.fixture
def path(tmp_path, monkeypatch):
    """A 0.5 km band of noise with gaps, in chunks that divide nothing."""
    rng = np.random.default_rng(3)
    radiance = rng.uniform(0.0, 600.0, SHAPE)
    radiance[rng.random(SHAPE) < 0.02] = np.nan
    flags = np.where(np.isnan(radiance), 3, rng.random(SHAPE) < 0.02)
    file = write_abi_l1b(tmp_path, band=2, radiance=radiance, dqf=flags)
    return in_chunks(file, (7, 10))


def in_chunks(file, chunks):
    """The same file with its image in such chunks."""
    whole = file.with_name(f"chunks-{file.name}")
    with netCDF4.Dataset(file) as old, netCDF4.Dataset(whole, "w") as new:
        old.set_auto_maskandscale(False)
        new.setncatts(old.__dict__)
        for name, dimension in old.dimensions.items():
            new.createDimension(name, dimension.size)
        for name, variable in old.variables.items():
            attributes = dict(variable.__dict__)
            copy = new.createVariable(
                name,
                variable.dtype,
                variable.dimensions,
                fill_value=attributes.pop("_FillValue", None),
                zlib=len(variable.shape) == 2,
                chunksizes=chunks if len(variable.shape) == 2 else None,
            )
            copy.set_auto_maskandscale(False)
            copy.setncatts(attributes)
            copy[...] = variable[...]
    file.unlink()
    return whole


@pytest.fixture(params=[8, 100, 2**20])
def tile_pixels(request, monkeypatch):
    monkeypatch.setattr(image_part, "_TILE_PIXELS", request.param)


@pytest.mark.parametrize("rows", [slice(None), slice(5, 6), slice(8, 24)])
@pytest.mark.parametrize("columns", [slice(None, 12), slice(11, 36)])
def test_a_window_is_a_part_of_the_whole(path, tile_pixels, rows, columns):
    whole, part = read_band(path), read_band(path, window=(rows, columns))
    np.testing.assert_array_equal(part.radiance, whole.radiance[rows, columns])
    np.testing.assert_array_equal(part.good, whole.good[rows, columns])
    np.testing.assert_array_equal(part.grid.x_rad, whole.grid.x_rad[columns])
    np.testing.assert_array_equal(part.grid.y_rad, whole.grid.y_rad[rows])
    assert not whole.good.all()
    assert (part.number, part.start, part.calibration) == (
        (whole.number, whole.start, whole.calibration)
    )


@pytest.mark.parametrize("block", [1, 2, 4, 12])
def test_blocks_are_those_of_the_common_grid(tmp_path, path, tile_pixels, block):
    shape = SHAPE[0] // block, SHAPE[1] // block
    coarse = write_abi_l1b(
        tmp_path,
        band=13,
        radiance=np.full(shape, 50.0),
        grid=window(shape, block * 1.4e-5),
    )
    scene = AbiScene({2: read_band(path), 13: read_band(coarse)})
    expected = scene.on_common_grid().bands[2]
    blocks = read_band(path, block=block)
    np.testing.assert_array_equal(blocks.radiance, expected.radiance)
    np.testing.assert_array_equal(blocks.good, expected.good)
    assert blocks.grid.same_as(expected.grid)


def test_blocks_of_a_window(path, tile_pixels):
    whole = read_band(path, block=4)
    part = read_band(path, window=(slice(4, 20), slice(16, 36)), block=4)
    np.testing.assert_array_equal(part.radiance, whole.radiance[1:5, 4:9])
    assert part.grid.shape == (4, 5)


def test_a_window_of_one_band_of_many(tmp_path):
    rng = np.random.default_rng(0)
    radiance = {band: rng.uniform(10.0, 90.0, (6, 8)) for band in (3, 13)}
    file = write_abi_cmi(tmp_path, radiance=radiance, multi_band=True)
    for band in radiance:
        whole = read_band(file, band=band)
        part = read_band(file, band=band, window=(slice(1, 3), slice(2, 8)))
        np.testing.assert_array_equal(part.radiance, whole.radiance[1:3, 2:8])


@pytest.mark.parametrize(
    ("rows", "block", "words"),
    [
        (slice(0, 25), 1, "no pixels 0 to 25 of 24"),
        (slice(-4, None), 1, "no pixels -4 to 24"),
        (slice(4, 4), 1, "no pixels 4 to 4"),
        (slice(0, 8, 2), 1, "no pixels 0 to 8"),
        (slice(2, 8), 4, "between multiples of 4"),
        (slice(None), 5, "blocks of 5 pixels from 0 to 24"),
        (slice(None), 0, "A block of 0 pixels is none"),
    ],
)
def test_windows_that_are_none(path, rows, block, words):
    with pytest.raises(DataError, match=words):
        read_band(path, window=(rows, slice(None)), block=block)


@pytest.mark.parametrize(
    ("chunks", "block", "step"),
    [((226, 226), 2, 226), ((226, 226), 4, 452), ((250, 250), 4, 500)],
)
def test_tiles_follow_the_chunks_of_noaas_files(chunks, block, step):
    """226 in full disks, 250 in the others (measured in such files)."""
    part = image_part.ImagePart(slice(0, 10 * step), slice(0, 10 * step), block)
    tiles = list(part.tiles(chunks))
    seen = np.zeros((10 * step, 10 * step), bool)
    for (rows, columns), (to_rows, to_columns) in tiles:
        for pixels, blocks in ((rows, to_rows), (columns, to_columns)):
            assert pixels.start % step == 0
            assert pixels.stop % step == 0
            assert (blocks.start * block, blocks.stop * block) == (
                (pixels.start, pixels.stop)
            )
        assert not seen[rows, columns].any()
        seen[rows, columns] = True
    assert seen.all()


def test_chunks_and_blocks_that_hardly_meet_make_no_huge_tiles():
    part = image_part.ImagePart(slice(0, 20000), slice(0, 20000), 100)
    sizes = [
        (rows.stop - rows.start) * (columns.stop - columns.start)
        for (rows, columns), _ in part.tiles((226, 226))
    ]
    assert sum(sizes) == 20000**2
    assert max(sizes) <= 2**20


def test_an_average_takes_little_memory(tmp_path):
    """The image is 4 million pixels, 16 MB as float32 and 4 MB as flags."""
    file = write_abi_l1b(tmp_path, band=2, radiance=np.full((2000, 2000), 90.0))
    file = in_chunks(file, (250, 250))
    peak = {}
    for block in (1, 4):
        tracemalloc.start()
        read_band(file, block=block)
        peak[block] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak[1] > 20e6
    assert peak[4] < peak[1] - 15e6
