"""Films of rendered frames, as animated pictures or as video."""

import os
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter

from cloudjax_data import DataError
from cloudjax_data.whole_files import staged

from .band_image import BandImage, BandPicture, shade_range


FRAMES_PER_SECOND = 8
_PANEL_INCHES, _DPI = 6.0, 100


@dataclass(frozen=True, eq=False)
class Frame:
    """A `Frame` is what a picture shows of one time.

    **Fields:** `title`: with the time; `bands`: an image of each.
    """

    title: str
    bands: tuple[BandImage, ...]


class FilmFormat(ABC):
    """A `FilmFormat` is a kind of file that films are written to."""

    def require(self) -> None:
        """Raise `DataError` where it cannot be written on this machine."""
        return

    @abstractmethod
    def writer(self) -> AbstractMovieWriter:
        """Return what writes it."""


class PictureFormat(FilmFormat):
    """A `PictureFormat` is a picture that moves, by Pillow."""

    def writer(self) -> AbstractMovieWriter:
        """Return matplotlib's writer of Pillow, which goes by the suffix."""
        return PillowWriter(fps=FRAMES_PER_SECOND)


class VideoFormat(FilmFormat):
    """A `VideoFormat` is a video, by ffmpeg."""

    def require(self) -> None:
        """Raise `DataError` where there is no ffmpeg."""
        if not FFMpegWriter.isAvailable():
            raise DataError(
                "A film as mp4 needs ffmpeg, which is not installed here: install it, "
                "or use --animation webp."
            )

    def writer(self) -> AbstractMovieWriter:
        """Return matplotlib's writer of ffmpeg."""
        return FFMpegWriter(fps=FRAMES_PER_SECOND)


FORMATS: dict[str, FilmFormat] = {
    "webp": PictureFormat(),
    "gif": PictureFormat(),
    "mp4": VideoFormat(),
}


def write_film(path: str | os.PathLike[str], frames: Sequence[Frame]) -> None:
    """Write frames of one size to a file whose suffix is one of `FORMATS`.

    All frames have one scale of shades, so that nothing flickers.

    **Raises:** `DataError` if the format or the disk does not take them.
    """
    path = Path(path)
    film = FORMATS[path.suffix.removeprefix(".")]
    film.require()
    bands = list(zip(*(frame.bands for frame in frames), strict=True))
    picture = BandPicture(
        frames[0].bands,
        frames[0].title,
        panel_inches=_PANEL_INCHES,
        missing="#10141a",
        ranges=[shade_range(images) for images in bands],
    )
    # Laid out once: a title of another width would move the panels.
    picture.figure.draw_without_rendering()
    picture.figure.set_layout_engine("none")
    writer = film.writer()
    with (
        staged(path.parent) as aside,
        writer.saving(picture.figure, str(aside / path.name), dpi=_DPI),
    ):
        writer.grab_frame()
        for frame in frames[1:]:
            picture.show(frame.bands, frame.title)
            writer.grab_frame()
