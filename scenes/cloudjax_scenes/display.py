"""How images of bands are shown."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Display:
    """A `Display` says how images of a band are shown: the label of their values, and
    shades.

    Thermal images are drawn with cold, that is small values, in white, as
    meteorologists do: clouds are bright in every band.
    """

    label: str
    thermal: bool = False

    @property
    def colormap(self) -> str:
        """Name of the matplotlib colour map."""
        return "gray_r" if self.thermal else "gray"


REFLECTANCE = Display("reflectance factor")
BRIGHTNESS_TEMPERATURE = Display("brightness temperature (K)", thermal=True)
