"""Particles against published values."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax.light.optics import ICE, WATER, Particles, ice, water


DOCUMENT = Path(__file__).parents[2] / "docs/theory/optics.md"

# Hu & Stamnes (1993), at the bands' central wavelengths, from libRadtran's data files:
# radius in µm: band: extinction in m²/g, asymmetry.
HU_STAMNES = {
    5.0: {1: (0.3179, 0.8517), 2: (0.3254, 0.8451), 5: (0.3461, 0.8069)},
    8.0: {1: (0.1951, 0.8616), 3: (0.2018, 0.8516), 4: (0.2045, 0.8410)},
    20.0: {2: (0.07802, 0.8720), 3: (0.07808, 0.8692), 5: (0.07999, 0.8662)},
    45.0: {1: (0.03375, 0.8786), 2: (0.03385, 0.8781), 5: (0.03427, 0.8816)},
}
# Absorption in m²/g of the same.
HU_STAMNES_ABSORPTION = {
    8.0: {13: 0.1661 * 0.3713, 14: 0.1370 * 0.5661, 15: 0.1508 * 0.6462},
    20.0: {11: 0.08919 * 0.4043, 13: 0.09449 * 0.4028, 16: 0.0812 * 0.5356},
    45.0: {8: 0.03586 * 0.4834, 13: 0.03695 * 0.4941, 16: 0.03594 * 0.4956},
}


def test_droplets_of_10_um_have_an_extinction_efficiency_of_about_2_1():
    """Geometry: spheres larger than the wavelength, band 2.

    Expectation: extinction 3 Q/(4 ρ r) = 0.1575 m²/g at 10 µm with Q = 2.1, which
    falls to 2 for large droplets. Source: van de Hulst (1957). Tolerance: 1 %.
    """
    assert float(WATER.extinction_in([2])[0]) == pytest.approx(0.1575, rel=0.01)
    large = float(water(60.0).extinction_in([2])[0])
    assert large * 4 / 3 * 60 == pytest.approx(2.04, rel=0.01)


@pytest.mark.parametrize(
    ("radius_um", "band", "extinction", "asymmetry"),
    [
        (9.5, 2, 0.1664893, 0.8598022),
        (10.5, 2, 0.1501142, 0.8617689),
        (9.5, 6, 0.1783315, 0.8389963),
        (10.5, 6, 0.1600369, 0.8460481),
    ],
)
def test_droplets_are_those_of_rrtmg(radius_um, band, extinction, asymmetry):
    """Geometry: RRTMG's bands 24 (0.63 to 0.78 µm) and 18 (2.15 to 2.5 µm).

    Expectation: its extliq1 and asyliq1. Source: AER's RRTMG_SW tables. Tolerance:
    0.5 % in extinction and 0.002 in asymmetry, for its bands are wider. Its co-albedo
    is not compared: within these bands water's absorption changes tenfold.
    """
    droplets = water(radius_um)
    assert float(droplets.extinction_in([band])[0]) == pytest.approx(
        extinction, rel=0.005
    )
    assert float(droplets.asymmetry_in([band])[0]) == pytest.approx(
        asymmetry, abs=0.002
    )


@pytest.mark.parametrize("radius_um", HU_STAMNES)
def test_droplets_are_those_of_hu_and_stamnes_away_from_their_joints(radius_um):
    """Geometry: droplets at 5, 8, 20 and 45 µm; the fits jump at 12 and 30 µm.

    Expectation: their extinction and asymmetry in bands 1 to 5. Source: Hu & Stamnes
    (1993, J. Climate 6, 728). Tolerance: 1 % and 0.004.
    """
    bands = list(HU_STAMNES[radius_um])
    extinction, asymmetry = np.array(list(HU_STAMNES[radius_um].values())).T
    droplets = water(radius_um)
    np.testing.assert_allclose(droplets.extinction_in(bands), extinction, rtol=0.01)
    np.testing.assert_allclose(droplets.asymmetry_in(bands), asymmetry, atol=0.004)


def _absorption(particles: Particles, bands: list[int]):
    """k (1 - ω) in m²/g, of bands that see thermal radiation alone."""
    return particles.extinction_in(bands) * particles.thermal_co_albedo_in(bands)


@pytest.mark.parametrize("radius_um", HU_STAMNES_ABSORPTION)
def test_droplets_absorb_as_those_of_hu_and_stamnes(radius_um):
    """Geometry: the same, infrared. Expectation: k (1 - ω).

    Source: as above. Tolerance: 2 %.
    """
    expected = HU_STAMNES_ABSORPTION[radius_um]
    found = _absorption(water(radius_um), list(expected))
    np.testing.assert_allclose(found, list(expected.values()), rtol=0.02)


def test_crystals_are_those_of_fu():
    """Geometry: hexagonal columns of generalised effective size 60 µm.

    Expectation: at 0.64 µm k = a0 + a1/D of Fu (1996, eq. 3.9a, 0.57 to 0.64 µm); at
    10.35 µm k (1 - ω) = Σ b_i D^i / D of Fu et al. (1998), between 10 and 11 µm.
    Tolerance: 1 % for the means over the bands.
    """
    size = 39.0 * 8 / (3 * np.sqrt(3))
    assert float(ICE.extinction_in([2])[0]) == pytest.approx(
        9.82e-05 + 2.50875 / size, rel=0.01
    )
    at_10 = np.polyval([7.378074e-07, -2.071124e-04, 1.993425e-02, 0.5187942], size)
    at_11 = np.polyval([3.126251e-07, -7.6833e-05, 5.7251e-03, 1.111773], size)
    assert float(_absorption(ICE, [13])[0]) == pytest.approx(
        (0.65 * at_10 + 0.35 * at_11) / size, rel=0.01
    )


def test_the_paper_s_figure_7_is_what_the_code_gives():
    """Geometry: stratus (10 µm, 0.35 g/m³), cirrus (45 µm, 0.01 g/m³), 16 bands.

    Expectation: docs/theory/optics.md. Source: Schinder et al. (2024, Fig. 7), with its
    slip of radius and diameter resolved there. Tolerance: the three digits printed.
    """
    text = DOCUMENT.read_text(encoding="utf-8")
    rows = [line.strip("| ").split("|") for line in text.splitlines()]
    table = np.array([list(map(float, r)) for r in rows if r[0].strip().isdigit()])
    assert len(table) == 16
    bands = range(1, 17)
    for particles, gram_per_m3, at in ((water(10.0), 0.35, 2), (ice(45.0), 0.01, 5)):
        extinction = 1e3 * gram_per_m3 * particles.extinction_in(bands)
        np.testing.assert_allclose(table[:, at], extinction, rtol=6e-3)
        co_albedo = particles.co_albedo_in(bands)
        np.testing.assert_allclose(table[:, at + 1], co_albedo, rtol=6e-3)
        np.testing.assert_allclose(
            table[:, at + 2], particles.asymmetry_in(bands), rtol=6e-3
        )


def test_an_extinction_is_a_water_content():
    """Geometry: droplets of 10 µm. Expectation: 0.055 1/m is 0.35 g/m³.

    Source: Schinder et al. (2024, Fig. 7). Tolerance: 1 %.
    """
    content = WATER.water_content_g_m3(jnp.asarray(0.055))
    assert float(content) == pytest.approx(0.35, rel=0.01)


@pytest.mark.parametrize(
    ("make", "radii_um"), [(water, (2.6, 11.9, 12.1, 31.0)), (ice, (10.0, 40.0, 64.0))]
)
def test_derivatives_by_radius_are_those_of_differences(make, radii_um):
    """Expectation: forward mode is the central difference in float64.

    Tolerance: 1e-6 of the largest derivative of a kind.
    """

    def everything(radius_um):
        particles: Particles = make(radius_um)
        return jnp.concatenate(
            [
                particles.relative_extinction_in([1, 6, 7, 13]),
                particles.co_albedo_in([1, 2, 5, 7]) / particles.co_albedo_in([6]),
                particles.asymmetry_in([1, 5, 16]),
                particles.relative_absorption_in([7, 16]),
                particles.infrared_ratio[None],
            ]
        )

    with jax.enable_x64(True):
        for radius_um in radii_um:
            found = jax.jacfwd(everything)(jnp.asarray(radius_um))
            step = 1e-5 * radius_um
            ends = everything(radius_um + step), everything(radius_um - step)
            expected = (ends[0] - ends[1]) / (2 * step)
            np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-8)


def test_beyond_the_table_its_ends_hold():
    """Expectation: values of the ends, with a derivative of zero, finite anywhere."""
    for radius_um in (1e-3, 1.0, 1e3):
        end = water(2.0 if radius_um < 2 else 65.0)
        np.testing.assert_allclose(
            water(radius_um).co_albedo_in([6]), end.co_albedo_in([6]), rtol=1e-4
        )
        slope = jax.grad(lambda r: water(r).co_albedo_in([6])[0])(radius_um)
        assert float(slope) == 0
    assert np.isfinite(water(2.0).extinction_in([])).all()


def test_emission_in_a_reflective_band_is_refused():
    with pytest.raises(ValueError, match="Band 2 sees no emission"):
        WATER.effective_absorption_in([2])
