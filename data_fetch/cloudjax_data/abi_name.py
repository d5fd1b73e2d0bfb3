"""The name of an ABI file says which scan it holds (PUG volume 3, appendix A)."""

import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta


# Bands of one scan start within a second of each other; the fastest repeat of a
# mesoscale sector is 30 seconds.
SAME_SCAN = timedelta(seconds=10)

_PATTERN = re.compile(
    r"[A-Z]{2}_ABI-(?P<level>L1b|L2)-(?P<product>\w+?)(?P<sector>M1|M2|M|C|F)"
    r"-M\d+(?:C(?P<band>\d\d))?_(?P<platform>G\d\d)"
    r"_s(?P<start>\d{13})(?P<tenths>\d)"
)


_IMAGES = {("L1b", "Rad"), ("L2", "CMIP"), ("L2", "MCMIP")}


@dataclass(frozen=True)
class AbiName:
    """An `AbiName` has the parts of a file name that tell scan and product apart.

    **Fields:**

    - `level`: "L1b" or "L2"; `product`: "Rad", "CMIP", "MCMIP", "ACHA", "COD" ...
    - `sector`: "F", "C", "M1" or "M2"; `platform`: "G16" ...
    - `band`: the number, None for products of many bands.
    - `start`: start of the scan, in UTC.
    """

    level: str
    product: str
    sector: str
    platform: str
    band: int | None
    start: datetime

    @property
    def is_image(self) -> bool:
        """Whether it holds an image of bands.

        Other products are made of a band and have its number in their names: winds.
        """
        return (self.level, self.product) in _IMAGES


def parse_abi_name(name: str) -> AbiName | None:
    """Return the parts of a name such as `OR_ABI-L1b-RadM1-M6C03_G17_s2019300...`.

    Whatever follows the start time may have been changed. None if the name is not that
    of an ABI product.
    """
    match = _PATTERN.match(name)
    if match is None:
        return None
    try:
        start = datetime.strptime(match["start"], "%Y%j%H%M%S").replace(tzinfo=UTC)
    except ValueError:
        return None
    return AbiName(
        match["level"],
        match["product"],
        match["sector"],
        match["platform"],
        int(match["band"]) if match["band"] else None,
        start + timedelta(milliseconds=100 * int(match["tenths"])),
    )
