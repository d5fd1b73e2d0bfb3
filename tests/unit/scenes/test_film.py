"""Films of frames: one scale for all, the time in each, whole or not there."""

import numpy as np
import pytest
from PIL import Image, ImageSequence

from cloudjax import nominal_bands
from cloudjax_scenes.band_image import BandImage, BandPicture
from cloudjax_scenes.film import Frame, write_film


BAND = nominal_bands()[2]


def frame(level: float, title: str) -> Frame:
    """A picture of reflectances: a grey square in air of one level."""
    values = np.full((40, 40), level)
    values[10:30, 10:30] = 0.5
    image = BandImage(BAND, {"kappa0": 1.0}, values)
    return Frame(title, (image,))


def shades(path) -> list[np.ndarray]:
    with Image.open(path) as film:
        frames = ImageSequence.Iterator(film)
        return [np.asarray(frame.convert("L"), float) for frame in frames]


@pytest.mark.parametrize("suffix", ["webp", "gif"])
def test_all_frames_have_one_scale_and_their_times(tmp_path, suffix):
    frames = [frame(0.1, "12:00 UTC"), frame(0.3, "12:30 UTC"), frame(1.0, "13:00 UTC")]
    write_film(tmp_path / f"film.{suffix}", frames)
    found = shades(tmp_path / f"film.{suffix}")
    assert len(found) == 3
    assert len({picture.shape for picture in found}) == 1
    rows, columns = found[0].shape
    # The middle of the panel, which the colour bar moves to the left.
    middle = [picture[rows // 2, int(0.42 * columns)] for picture in found]
    assert np.ptp(middle) <= 2
    assert middle[0] == pytest.approx(127, abs=6)
    title = [picture[: rows // 16] for picture in found]
    assert np.abs(title[0] - title[1]).max() > 50
    assert [file.name for file in tmp_path.iterdir()] == [f"film.{suffix}"]


def test_a_film_that_fails_leaves_the_one_that_was_there(tmp_path, monkeypatch):
    def show(picture, images, title):
        raise KeyboardInterrupt

    monkeypatch.setattr(BandPicture, "show", show)
    file = tmp_path / "film.gif"
    file.write_bytes(b"before")
    with pytest.raises(KeyboardInterrupt):
        write_film(file, [frame(0.1, "a"), frame(0.2, "b")])
    assert file.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [file]
