"""A differentiable renderer of deterministic, fractal, three-dimensional clouds."""

import importlib.metadata

from .atmosphere import (
    AbstractTemperature as AbstractTemperature,
    StandardAtmosphere as StandardAtmosphere,
    TemperatureProfile as TemperatureProfile,
)
from .bands import (
    EmissiveBands as EmissiveBands,
    ReflectiveBands as ReflectiveBands,
)
from .cloud import (
    CloudFunction as CloudFunction,
    FractalCloud as FractalCloud,
    Latent as Latent,
)
from .fixed_grid import FixedGrid as FixedGrid
from .geodesy import GRS80 as GRS80, Ellipsoid as Ellipsoid
from .light import AbstractReflection as AbstractReflection, TwoFlux as TwoFlux
from .optics import ICE as ICE, WATER as WATER, Particles as Particles
from .rays import Rays as Rays
from .scene import (
    BandRadiances as BandRadiances,
    Layer as Layer,
    Scene as Scene,
    View as View,
    navigate as navigate,
    radiances as radiances,
    render as render,
    sample as sample,
)
from .shell import Shell as Shell
from .source import AbstractCloudSource as AbstractCloudSource, Occupancy as Occupancy
from .texture import (
    InvertedWorley as InvertedWorley,
    Perlin as Perlin,
    Texture as Texture,
    make_texture as make_texture,
)
from .weather import (
    Conditions as Conditions,
    MaskGrid as MaskGrid,
    cloud_classes as cloud_classes,
    cloud_fraction as cloud_fraction,
    fraction_to_mask as fraction_to_mask,
    load_classes as load_classes,
)


__version__ = importlib.metadata.version("cloudjax")
