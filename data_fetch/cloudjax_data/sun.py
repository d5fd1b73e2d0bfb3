"""The sun has a direction and a distance at each time."""

from datetime import datetime

import numpy as np
from jaxtyping import Float64


# The Earth's, by which the algorithm finds the sun's parallax for an observer.
_RADIUS_M = 6_378_140.0


def sun_direction(time: datetime) -> Float64[np.ndarray, "3"]:
    """Return the unit vector from the Earth's centre to the sun, in Earth-fixed (ECEF)
    axes.

    **Arguments:**

    - `time`: with a time zone.

    Geometric, that is without refraction; good to 0.0003 degree by the algorithm of
    Reda and Andreas (2004). Raises `ValueError` for a time without zone.
    """
    if time.tzinfo is None:
        raise ValueError(f"{time} has no time zone: use datetime(..., tzinfo=UTC).")
    # pandas and scipy come with it, a second that readers of files need not wait
    import pandas as pd
    from pvlib.solarposition import spa_python

    # At latitude 0, longitude 0 the local up, east and north are the ECEF x, y and z;
    # an observer a radius below sea level is the centre, where parallax vanishes.
    position = spa_python(pd.DatetimeIndex([time]), 0.0, 0.0, altitude=-_RADIUS_M)
    zenith = np.radians(position["zenith"].to_numpy()[0])
    azimuth = np.radians(position["azimuth"].to_numpy()[0])
    return np.array(
        [
            np.cos(zenith),
            np.sin(zenith) * np.sin(azimuth),
            np.sin(zenith) * np.cos(azimuth),
        ]
    )


def earth_sun_distance_au(time: datetime) -> float:
    """Return the distance from the Earth to the sun in astronomical units (Reda and
    Andreas).
    """
    import pandas as pd
    from pvlib.solarposition import nrel_earthsun_distance

    return float(nrel_earthsun_distance(pd.DatetimeIndex([time])).iloc[0])
