"""Everything of a scene from imagery that a fit may move, with bounds and priors.

Names are for users: a class of cloud and a short name, such as "low_stratus.threshold",
"light.indirect", or what is left of the air, such as "air.gain_C13". Where the numbers
sit in the scene is told by paths.
"""

from collections.abc import Iterable

from cloudjax import Band, ClassParameter, CloudClass, nominal_bands
from cloudjax.clouds.class_parameters import RESPONSES, SIZE_BANDS
from cloudjax_scenes.imagery import Imagery
from cloudjax_scenes.imagery_scene import SceneFromImagery, path_reflectance
from cloudjax_scenes.lights import LIGHTS, PAPER, Light

from .parameters import Parameter


def scene_parameters(made_of: SceneFromImagery) -> list[Parameter]:
    """List everything that may be fitted.

    The gauge of eq. (1) is fixed by holding the first weight and the strength of the
    barriers at 1 (see `cloudjax.clouds.cloud_function`): they are not listed.
    """
    imagery, light = made_of.imagery, made_of.light
    emissive = imagery.emissive
    found = [
        class_parameter(one, parameter, light)
        for one in made_of.classes
        for parameter in one.parameters
        if parameter.key not in _untold(one, imagery)
    ]
    if imagery.sunlit:
        if light is PAPER:
            found.append(_indirect())
        for i, band in enumerate(imagery.sunlit):
            found += _reflective_air(i, band, light)
    if emissive:
        found.append(_temperature_offset())
        found += [_emissive_gain(i, band, light) for i, band in enumerate(emissive)]
    return found


def _untold(one: CloudClass, imagery: Imagery) -> set[str]:
    """Keys of a class that nothing in the imagery tells."""
    told = {
        "infrared_ratio": bool(imagery.emissive),
        "effective_radius_um": any(b.number in SIZE_BANDS for b in imagery.sunlit),
        **dict.fromkeys(RESPONSES, one.name in imagery.evidence),
    }
    return {key for key, known in told.items() if not known}


def known_names(classes: Iterable[CloudClass]) -> list[str]:
    """Return the names of all that scenes of these classes may have, in any light."""
    rows = [
        class_parameter(one, each, PAPER) for one in classes for each in one.parameters
    ]
    rows += [_indirect(), _temperature_offset()]
    for light in LIGHTS.values():
        for band in nominal_bands().values():
            rows += _reflective_air(0, band, light) if band.sunlit else []
            rows += [] if band.reflective else [_emissive_gain(0, band, light)]
    return list(dict.fromkeys(parameter.name for parameter in rows))


def class_parameter(
    one: CloudClass, parameter: ClassParameter, light: Light
) -> Parameter:
    """Return a parameter of a class in the units of the light's own extinction."""
    factor, prior = light_factor(parameter.key, light), parameter.prior
    return Parameter(
        f"{one.name}.{parameter.name}",
        f"layers.{one.name}.{parameter.path}",
        factor * parameter.default,
        factor * prior.lower,
        factor * prior.upper,
        prior.spread,
        parameter.unit,
        prior.log,
        prior.free,
    )


def light_factor(key: str, light: Light) -> float:
    """Return what a physical number of a class is multiplied by for a light."""
    factors = {"extinction_per_m": light.share, "infrared_ratio": 1 / light.share}
    return factors.get(key, 1.0)


def _indirect() -> Parameter:
    return Parameter("light.indirect", "reflection.indirect", 0.3, 0.0, 1.0, 0.2)


def _temperature_offset() -> Parameter:
    return Parameter(
        "air.temperature_offset", "temperature.offset_k", 0.0, -15.0, 15.0, 5.0, "K"
    )


def _reflective_air(i: int, band: Band, light: Light) -> list[Parameter]:
    """What is left of the air, and the calibration.

    Where the air is computed its path is held: a scene knows it no better.
    """
    path = path_reflectance(band, light)
    spread = (0.005, 0.05) if light.air else (0.01 + 0.5 * path, 0.1)
    prior = 1.0, 0.5, 1.5, spread[1]
    gain = f"reflective.gain.{i}"
    if not band.reflective:
        return [Parameter(f"air.sun_gain_{band.name}", gain, *prior)]
    return [
        Parameter(
            f"air.path_{band.name}",
            f"reflective.path.{i}",
            path,
            -0.1,
            0.3,
            spread[0],
            free=not light.air,
        ),
        Parameter(f"air.gain_{band.name}", gain, *prior),
    ]


def _emissive_gain(i: int, band: Band, light: Light) -> Parameter:
    spread = 0.01 if light.air else 0.03
    return Parameter(
        f"air.gain_{band.name}",
        f"emissive.gain.{i}",
        1.0,
        0.7,
        1.2,
        spread,
        free=not light.air,
    )
