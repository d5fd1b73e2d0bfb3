"""Bands as files of ABI have them, for renders that are to be in their radiances."""

from cloudjax import Band, nominal_bands
from cloudjax_data import AbiBand, ReflectiveCalibration, earth_sun_distance_au
from cloudjax_data.nominal import nominal


def band_of_file(band: AbiBand) -> Band:
    """Return a band with the coefficients of its file; band 7 sees the sun."""
    c, distance_au = band.calibration, earth_sun_distance_au(band.time)
    if isinstance(c, ReflectiveCalibration):
        # The files round kappa0 to five digits, and have a distance of their own.
        irradiance = c.solar_irradiance_w_m2_um
        solar = irradiance * (distance_au / c.earth_sun_distance_au) ** 2
        return Band(band.number, band.wavelength_um, solar)
    # Files of band 7 have no solar irradiance.
    return Band(
        band.number,
        band.wavelength_um,
        nominal_bands()[band.number].solar_irradiance,
        (c.fk1, c.fk2, c.bc1, c.bc2),
    )


def band_of_satellite(platform: str, number: int) -> Band:
    """Return a band as a satellite such as "G17" has it nominally; of one not known,
    that of GOES-16.
    """
    known, usual = nominal(platform, number), nominal_bands()[number]
    solar = usual.solar_irradiance if known.esun is None else known.esun
    return Band(number, known.wavelength_um, solar, known.planck)
