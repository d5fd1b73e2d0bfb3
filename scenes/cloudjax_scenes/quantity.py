"""What the pixels of a file may hold: radiance, reflectance, brightness temperature."""

import re
from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """A `Quantity` is one of those that files and pictures show.

    **Fields:**

    - `name`: on the command line.
    - `standard_name`: of CF, with a place for what radiance is per.
    - `units`: of CF; empty for radiance, whose units are those of the band's file.
    """

    name: str
    standard_name: str
    units: str

    @property
    def words(self) -> str:
        """Give the name as a reader sees it."""
        return self.name.replace("-", " ")

    @property
    def variable(self) -> str:
        """Give the name of its variables, up to the band's."""
        return self.name.replace("-", "_")


RADIANCE = Quantity("radiance", "toa_outgoing_radiance_per_unit_{per}", "")
REFLECTANCE = Quantity("reflectance", "toa_bidirectional_reflectance", "1")
BRIGHTNESS_TEMPERATURE = Quantity(
    "brightness-temperature", "toa_brightness_temperature", "K"
)
QUANTITIES = {q.name: q for q in (RADIANCE, REFLECTANCE, BRIGHTNESS_TEMPERATURE)}
ALL = "all"

_VARIABLE = re.compile(
    rf"({'|'.join(q.variable for q in QUANTITIES.values())})_C(\d\d)$"
)


def parse_variable(name: str) -> tuple[Quantity, int] | None:
    """Return quantity and band of a variable as `radiance_C13`, None for others."""
    found = _VARIABLE.match(name)
    if found is None:
        return None
    return QUANTITIES[found[1].replace("_", "-")], int(found[2])
