"""Quantities of bands: satpy's formulas, CF attributes, what is refused."""

import netCDF4
import numpy as np
import pytest
import xarray as xr

from cloudjax import nominal_bands
from cloudjax_data import DataError, open_folder
from cloudjax_fit.comparison import compare
from cloudjax_fit.radiance_files import read_radiances
from cloudjax_scenes.band_image import BandImage, chosen_quantities
from cloudjax_scenes.imagery_reduction import reduce_scene
from cloudjax_scenes.quantity import QUANTITIES


BANDS = nominal_bands()
EVERY = tuple(QUANTITIES.values())
QUANTILES = np.linspace(0.01, 0.99, 50)


def image(number: int, level: float = 50.0) -> BandImage:
    radiance = np.full((3, 4), level, np.float32)
    radiance[0, 0] = np.nan
    band = BANDS[number]
    return BandImage(band, band.coefficients(0.99), radiance)


def test_a_band_has_radiance_and_one_quantity_to_look_at():
    assert list(image(2).variables(EVERY)) == ["radiance_C02", "reflectance_C02"]
    found = image(13).variables(EVERY)
    assert list(found) == ["radiance_C13", "brightness_temperature_C13"]
    attributes = found["brightness_temperature_C13"].attrs
    assert attributes["standard_name"] == "toa_brightness_temperature"
    assert attributes["units"] == "K"
    assert attributes["abi_band"] == 13
    names = {v.attrs["standard_name"] for v in image(2).variables(EVERY).values()}
    assert names == {
        "toa_outgoing_radiance_per_unit_wavelength",
        "toa_bidirectional_reflectance",
    }


def test_the_factor_knows_how_far_the_sun_is():
    (variable,) = image(2, 100.0).variables([QUANTITIES["reflectance"]]).values()
    assert variable.attrs["units"] == "1"
    assert float(variable[1, 1]) == pytest.approx(100 * np.pi * 0.99**2 / 1631.3351)
    assert np.isnan(variable[0, 0])


@pytest.mark.shared_data
def test_quantities_are_those_of_satpy(shared_data):
    """A day scene of GOES-17, bands 1, 3, 7 and 13, as satpy's ABI reader calibrates.

    πL d²/E_sun with the file's E_sun and distance, and (fk2/ln(fk1/L + 1) - bc1)/bc2,
    within 1e-5; band 7 by day has both kinds of coefficients and is a temperature.
    """
    folder = open_folder(shared_data / "goes17_m1_20191027T2000")
    reduced = reduce_scene(folder.read([1, 3, 7, 13]))
    imagery = reduced.imagery
    assert imagery.bands[7].sunlit
    assert not imagery.bands[7].reflective
    for number, band in imagery.bands.items():
        radiance = np.quantile(reduced.radiance[number][reduced.cloud], QUANTILES)
        with netCDF4.Dataset(folder.bands[number]) as file:
            known = {
                name: float(file[name][...])
                for name in file.variables
                if name.startswith(("esun", "earth_sun", "planck_"))
                and not np.ma.is_masked(file[name][...])
            }
        if number < 7:
            distance = known["earth_sun_distance_anomaly_in_AU"]
            expected = radiance * np.pi * distance**2 / known["esun"]
        else:
            fk1, fk2, bc1, bc2 = (
                known[f"planck_{name}"] for name in ("fk1", "fk2", "bc1", "bc2")
            )
            expected = (fk2 / np.log(fk1 / radiance + 1) - bc1) / bc2
        shown = BandImage(band, imagery.coefficients(number), radiance).shown
        np.testing.assert_allclose(shown, expected, rtol=1e-5)


def test_what_no_band_has_is_refused():
    pair = [BANDS[2], BANDS[13]]
    assert [q.name for q in chosen_quantities(["all"], pair)] == list(QUANTITIES)
    found = chosen_quantities(["reflectance", "radiance"], pair)
    assert [q.name for q in found] == ["radiance", "reflectance"]
    with pytest.raises(DataError, match="No band of 7, 13 has a reflectance"):
        chosen_quantities(["reflectance"], [BANDS[7], BANDS[13]])
    with pytest.raises(DataError, match="No band of 2 has a brightness temperature"):
        chosen_quantities(["brightness-temperature"], [BANDS[2]])


def test_reports_do_not_mix_quantities(tmp_path):
    kelvin = [QUANTITIES["brightness-temperature"]]
    for name, quantities in (("a", EVERY), ("b", kelvin)):
        variables = image(13).variables(quantities)
        xr.Dataset(variables).to_netcdf(tmp_path / f"{name}.nc")
    a, b = (read_radiances(tmp_path / f"{name}.nc") for name in "ab")
    assert a[13].quantity is QUANTITIES["radiance"]
    assert b[13].units == "K"
    with pytest.raises(DataError, match="a gives radiance in band 13 and b brightness"):
        compare(a, b, ("a", "b"))
    assert compare(b, b, ("b", "b")).bands[0].distances.w1 == 0
