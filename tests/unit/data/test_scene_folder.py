"""What a folder holds, and the sentence for each folder that will not do."""

import os
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

from cloudjax_data import DataError, open_folder
from tests.generated import SCAN_START, write_abi_cmi, write_abi_l1b


COARSE = np.full((3, 4), 60.0)
FINE = np.full((6, 8), 60.0)


@pytest.fixture
def folder(tmp_path):
    write_abi_l1b(tmp_path, band=3, radiance=FINE)
    write_abi_l1b(tmp_path, band=13, radiance=COARSE)
    return tmp_path


def test_contents(folder):
    stamp = "s20193002000275_e20193002000332_c20193002004000"
    product = folder / f"OR_ABI-L2-ACHAM1-M6_G17_{stamp}.nc"
    product.write_bytes(b"only listed")
    (folder / "gfs.t18z.pgrb2.0p25.f000").write_bytes(b"GRIB and so on")
    (folder / "scene.toml").write_text("[sun]\nmodel = 'none'\n")
    (folder / "notes.txt").write_text("fog")
    found = open_folder(folder)
    assert list(found.bands) == [3, 13]
    assert found.products == {"ACHA": product}
    assert [path.name for path in found.weather] == ["gfs.t18z.pgrb2.0p25.f000"]
    assert found.settings == {"sun": {"model": "none"}}
    assert [path.name for path in found.ignored] == ["notes.txt"]
    assert (found.platform, found.sector) == ("G17", "M1")
    assert found.start == SCAN_START


def test_reading(folder):
    assert list(open_folder(folder).read().bands) == [3, 13]
    assert list(open_folder(folder).read([13]).bands) == [13]


def test_conditionally_usable_pixels_can_be_kept(folder):
    dqf = np.ones(COARSE.shape, int)
    write_abi_l1b(folder, band=14, radiance=COARSE, dqf=dqf)
    found = open_folder(folder)
    assert not found.read([14]).bands[14].good.any()
    lenient = found.read([14], keep_conditionally_usable=True)
    assert lenient.bands[14].good.all()


def test_renamed_files_are_recognised_by_their_header(tmp_path):
    write_abi_l1b(tmp_path, band=13, radiance=COARSE, name="infrared.nc")
    assert list(open_folder(tmp_path).bands) == [13]


def test_l1b_is_preferred_to_cmi(folder):
    write_abi_cmi(folder, radiance={13: COARSE})
    write_abi_cmi(folder, radiance={7: COARSE / 100, 13: COARSE}, multi_band=True)
    found = open_folder(folder)
    assert "L1b" in found.bands[13].name
    assert "MCMIP" in found.bands[7].name
    assert list(found.read([7, 13]).bands) == [7, 13]


def test_missing_bands_are_named(folder):
    with pytest.raises(DataError, match=r"does not hold band 1, 7 .*holds: 3, 13\)"):
        open_folder(folder).read([1, 7, 13])


def test_several_scans_are_listed(folder):
    later = SCAN_START + timedelta(minutes=1)
    write_abi_l1b(folder, band=14, radiance=COARSE, start=later)
    with pytest.raises(DataError, match=r"20:00:27; G17 M1 2019-10-27 20:01:27"):
        open_folder(folder)


@pytest.mark.parametrize("other", [{"platform": "G16"}, {"sector": "M2"}])
def test_satellites_and_sectors_are_not_mixed(folder, other):
    write_abi_l1b(folder, band=14, radiance=COARSE, **other)
    with pytest.raises(DataError, match="several scans"):
        open_folder(folder)


def test_bands_that_start_apart_by_tenths_are_one_scan(folder):
    start = SCAN_START + timedelta(seconds=0.4)
    write_abi_l1b(folder, band=14, radiance=COARSE, start=start)
    assert list(open_folder(folder).read().bands) == [3, 13, 14]


def test_a_file_that_lies_about_its_band_is_refused(folder):
    name = open_folder(folder).bands[13].name
    write_abi_l1b(folder, band=14, radiance=COARSE, name=name)
    with pytest.raises(DataError, match="holds band 14 and not 13"):
        open_folder(folder).read([13])


def test_paths_that_are_no_scene(tmp_path):
    with pytest.raises(DataError, match="does not exist"):
        open_folder(tmp_path / "nowhere")
    with pytest.raises(DataError, match="holds no ABI file"):
        open_folder(tmp_path)
    file = tmp_path / "notes.txt"
    file.write_text("fog")
    with pytest.raises(DataError, match="is a file"):
        open_folder(file)
    with pytest.raises(DataError, match="holds no ABI file"):
        open_folder(tmp_path)


def test_toml_errors_are_named(folder):
    (folder / "scene.toml").write_text("bands = [1, ")
    with pytest.raises(DataError, match=r"scene\.toml is not valid TOML"):
        open_folder(folder)


@pytest.mark.parametrize("product", ["DMW", "DMWV", "CPS", "ACHA2KM"])
def test_only_images_are_bands(folder, product):
    """Winds are made of a band and have its number in their names."""
    stamp = "s20193002000275_e20193002000332_c20193002004000"
    winds = folder / f"OR_ABI-L2-{product}M1-M6C14_G17_{stamp}.nc"
    winds.write_bytes(b"only listed")
    found = open_folder(folder)
    assert list(found.bands) == [3, 13]
    assert found.products == {f"{product}-C14": winds}


def test_files_of_many_bands_tell_which(tmp_path):
    write_abi_cmi(tmp_path, radiance={2: COARSE, 13: COARSE}, multi_band=True)
    assert list(open_folder(tmp_path).bands) == [2, 13]


def test_weather_is_told_by_its_first_message(folder):
    """Behind the heading of a bulletin too; texts may speak of GRIB."""
    heading = b"\r\r\n018 \r\r\nYUQA85 KWBC 271800\r\r\n"
    (folder / "bulletin").write_bytes(heading + b"GRIB\0\1\2\1 and so on")
    (folder / "second.grib2").write_bytes(b"\n\nGRIB\xff\xff\0\2 and so on")
    (folder / "README").write_text("The GRIB files are those of the hour.")
    (folder / "photo.jpg").write_bytes(b"\xff\xd8\xff\xe0GRIB\0\1\2\1")
    found = [file.name for file in open_folder(folder).weather]
    assert found == ["bulletin", "second.grib2"]


def test_strangers_do_not_spoil_a_scene(folder):
    name = open_folder(folder).bands[13].name
    (folder / f"._{name}").write_bytes(b"\0\5\x16\7\0\2\0\0Mac OS X")
    (folder / "._gfs.grib2").write_bytes(b"GRIB and no more")
    (folder / ".DS_Store").write_bytes(b"\0\0\0\1Bud1")
    (folder / "mine.nc").write_text("no netCDF")
    (folder / "empty.nc").write_bytes(b"")
    (folder / "gone.nc").symlink_to(folder / "nowhere.nc")
    found = open_folder(folder)
    assert list(found.bands) == [3, 13]
    assert not found.weather
    assert [file.name for file in found.unreadable] == ["empty.nc", "mine.nc"]
    assert set(found.unreadable) <= set(found.ignored)
    assert list(found.read().bands) == [3, 13]


def test_files_that_may_not_be_opened_do_not_spoil_a_scene(folder, monkeypatch):
    locked = folder / "notes.txt"
    locked.write_text("secret")
    real = type(locked).open

    def refuse(path, *arguments, **options):
        if path == locked:
            raise PermissionError(13, "Permission denied", str(path))
        return real(path, *arguments, **options)

    monkeypatch.setattr(type(locked), "open", refuse)
    assert open_folder(folder).unreadable == (locked,)


def test_a_folder_of_broken_files_names_them(tmp_path):
    (tmp_path / "infrared.nc").write_text("half of a file")
    with pytest.raises(DataError, match=r"no ABI file.*\(infrared\.nc cannot be read"):
        open_folder(tmp_path)


@pytest.mark.parametrize("suffix", [".nc", ""])
def test_names_may_be_no_text(folder, suffix):
    """Bytes of another encoding, as archives from elsewhere leave them."""
    odd = folder / os.fsdecode(b"sc\xe8ne" + suffix.encode())
    odd.mkdir()
    write_abi_l1b(folder, band=14, radiance=COARSE)
    for file in folder.glob("OR_*"):
        file.rename(odd / file.name)
    (odd / open_folder(odd).bands[14].name).rename(odd / os.fsdecode(b"\xff.nc"))
    found = open_folder(odd)
    assert list(found.bands) == [3, 13, 14]
    assert found.read([14]).bands[14].good.all()
    (odd / os.fsdecode(b"\xff.nc")).write_bytes(b"\x89HDF\r\n\x1a\n and no more")
    assert len(open_folder(odd).unreadable) == 1


def test_a_byte_order_mark_is_skipped(folder):
    (folder / "scene.toml").write_bytes(b"\xef\xbb\xbf[fit]\r\nrays = 9\r\n")
    assert open_folder(folder).settings == {"fit": {"rays": 9}}


@pytest.mark.parametrize("encoding", ["utf-16", "utf-32", "utf-16-be"])
def test_other_encodings_of_settings_are_named(folder, encoding):
    text = "# \u00fc\n[fit]\nrays = 9\n"
    content = text.encode(encoding)
    if encoding == "utf-16-be":
        content = b"\xfe\xff" + content
    (folder / "scene.toml").write_bytes(content)
    with pytest.raises(DataError, match=r"UTF-(16|32), and TOML is in UTF-8: save it"):
        open_folder(folder)
    (folder / "scene.toml").write_bytes("# \u00fc".encode("latin-1"))
    with pytest.raises(DataError, match="is not text in UTF-8"):
        open_folder(folder)


def test_weather_alone_has_no_bands(tmp_path):
    (tmp_path / "gfs").write_bytes(b"GRIB")
    found = open_folder(tmp_path)
    assert found.start is None
    with pytest.raises(DataError, match="does not hold any band"):
        found.read()


@pytest.mark.parametrize("name", ["Scene.TOML", "scene.toml.txt"])
def test_settings_of_another_name_do_not_go_unread(folder, name):
    (folder / name).write_text("[fit]\nrays = 9\n")
    with pytest.raises(DataError, match=f"{name} is read by nothing: call it scene"):
        open_folder(folder)
    (folder / "scene.toml").write_text("[fit]\nrays = 8\n")
    assert open_folder(folder).settings == {"fit": {"rays": 8}}


@pytest.mark.parametrize("make", [Path.mkdir, lambda p: p.symlink_to("nowhere.toml")])
def test_settings_that_are_no_file_do_not_go_unread(folder, make):
    make(folder / "scene.toml")
    with pytest.raises(DataError, match=r"scene\.toml is no file of settings"):
        open_folder(folder)
