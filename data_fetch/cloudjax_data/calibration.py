"""Radiance is turned into reflectance or brightness temperature and back, as the file
says.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from cloudjax.light import planck


# CODATA 2018, in the units of the ABI coefficients: fk1 = c1 nu^3, fk2 = c2 nu with
# nu in cm-1 and radiance in mW m-2 sr-1 (cm-1)-1.
FIRST_RADIATION_CONSTANT = 1.191042972e-5
SECOND_RADIATION_CONSTANT_CM_K = 1.438776877

WAVELENGTH_UNITS = "W m-2 sr-1 um-1"
WAVENUMBER_UNITS = "mW m-2 sr-1 (cm-1)-1"

# GOES-16 and -17 files agree to 3e-5 and 5e-6. A public list of coefficients is off by
# 3e-4 in fk2 of band 14, a tenth of a kelvin, which the second must catch.
_KAPPA0_TOLERANCE = 1e-3
_FK2_TOLERANCE = 1e-4


@dataclass(frozen=True)
class ReflectiveCalibration:
    """Bands 1 to 6 have radiance in W m-2 sr-1 um-1.

    **Fields:**

    - `reflectance_per_radiance`: `kappa0` of the file, pi d^2 / esun.
    - `solar_irradiance_w_m2_um`: `esun`, at the mean distance of the sun.
    - `earth_sun_distance_au`: d. The files call it `earth_sun_distance_anomaly_in_AU`,
        but it is the distance itself.
    """

    reflectance_per_radiance: float
    solar_irradiance_w_m2_um: float
    earth_sun_distance_au: float

    @classmethod
    def of_sun(
        cls, solar_irradiance_w_m2_um: float, earth_sun_distance_au: float
    ) -> "ReflectiveCalibration":
        """Make that of a solar irradiance at the mean distance, and of a distance."""
        kappa0 = np.pi * earth_sun_distance_au**2 / solar_irradiance_w_m2_um
        return cls(float(kappa0), solar_irradiance_w_m2_um, earth_sun_distance_au)

    @property
    def units(self) -> str:
        """Give the units of the radiance."""
        return WAVELENGTH_UNITS

    def reflectance(
        self, radiance: Float[np.ndarray, "*pixels"]
    ) -> Float[np.ndarray, "*pixels"]:
        """Return the reflectance factor, 0 to 1 and not divided by the cosine of the
        solar zenith angle.

        Negative where the radiance is: detector noise about zero is kept.
        """
        return radiance * self.reflectance_per_radiance

    def radiance(
        self, reflectance: Float[np.ndarray, "*pixels"]
    ) -> Float[np.ndarray, "*pixels"]:
        """Invert `reflectance`."""
        return reflectance / self.reflectance_per_radiance

    def inconsistency(self) -> str | None:
        """Say what is wrong with the coefficients, or return None if they agree."""
        d, esun = self.earth_sun_distance_au, self.solar_irradiance_w_m2_um
        ratio = self.reflectance_per_radiance * esun / (np.pi * d**2)
        if abs(ratio - 1) <= _KAPPA0_TOLERANCE:
            return None
        return f"kappa0 is {ratio:.4f} times pi d^2 / esun"


@dataclass(frozen=True)
class EmissiveCalibration:
    """Bands 7 to 16 have radiance in mW m-2 sr-1 (cm-1)-1.

    **Fields:**

    - `fk1`, `fk2`, `bc1`, `bc2`: the Planck coefficients of the file.
    - `smallest_positive_radiance`: what the first count above zero radiance stands
        for; brightness temperatures are clipped there.
    """

    fk1: float
    fk2: float
    bc1: float
    bc2: float
    smallest_positive_radiance: float = 1e-6

    @property
    def units(self) -> str:
        """Give the units of the radiance."""
        return WAVENUMBER_UNITS

    def brightness_temperature_k(
        self, radiance: Float[np.ndarray, "*pixels"]
    ) -> Float[np.ndarray, "*pixels"]:
        """Return the brightness temperature [K]; it is NaN only where the radiance is
        NaN.

        Negative radiances are noise of cold scenes and have no temperature: they get
        that of the smallest positive count (197.5 K in band 7).
        """
        positive = np.maximum(radiance, self.smallest_positive_radiance)
        return planck.brightness_temperature_k(*self._planck, positive)

    def radiance(
        self, brightness_temperature_k: Float[np.ndarray, "*pixels"]
    ) -> Float[np.ndarray, "*pixels"]:
        """Invert `brightness_temperature_k`; the result is always finite."""
        return planck.radiance(*self._planck, brightness_temperature_k)

    @property
    def _planck(self) -> tuple[float, float, float, float]:
        return self.fk1, self.fk2, self.bc1, self.bc2

    def inconsistency(self) -> str | None:
        """Say what is wrong with the coefficients, or return None if they agree."""
        wavenumber = np.cbrt(self.fk1 / FIRST_RADIATION_CONSTANT)
        ratio = self.fk2 / (SECOND_RADIATION_CONSTANT_CM_K * wavenumber)
        if abs(ratio - 1) <= _FK2_TOLERANCE:
            return None
        return f"fk2 is {ratio:.4f} times c2 (fk1 / c1)^(1/3)"


Calibration = ReflectiveCalibration | EmissiveCalibration
