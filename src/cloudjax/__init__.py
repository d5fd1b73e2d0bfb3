"""A differentiable renderer of deterministic, fractal, three-dimensional clouds."""

import importlib.metadata

from .air.atmosphere import (
    AbstractTemperature as AbstractTemperature,
)
from .air.atmosphere import (
    StandardAtmosphere as StandardAtmosphere,
)
from .air.atmosphere import (
    TemperatureProfile as TemperatureProfile,
)
from .air.clear_air import Air as Air
from .clouds.class_files import class_table as class_table
from .clouds.class_files import cloud_classes as cloud_classes
from .clouds.class_files import imagery_classes as imagery_classes
from .clouds.class_files import load_classes as load_classes
from .clouds.class_parameters import ClassParameter as ClassParameter
from .clouds.class_parameters import Prior as Prior
from .clouds.classes import ClassTexture as ClassTexture
from .clouds.classes import CloudClass as CloudClass
from .clouds.classes import ImageryRule as ImageryRule
from .clouds.cloud_function import CloudFunction as CloudFunction
from .clouds.fractal import (
    FractalCloud as FractalCloud,
)
from .clouds.fractal import (
    Latent as Latent,
)
from .clouds.gridded import GriddedCloud as GriddedCloud
from .clouds.source import AbstractCloudSource as AbstractCloudSource
from .clouds.source import Occupancy as Occupancy
from .clouds.source import Slopes as Slopes
from .clouds.texture import (
    InvertedWorley as InvertedWorley,
)
from .clouds.texture import (
    Perlin as Perlin,
)
from .clouds.texture import (
    Texture as Texture,
)
from .clouds.texture import (
    make_texture as make_texture,
)
from .geometry.camera import Camera as Camera
from .geometry.fixed_grid import FixedGrid as FixedGrid
from .geometry.footprint import POINT as POINT
from .geometry.footprint import Footprint as Footprint
from .geometry.geodesy import GRS80 as GRS80
from .geometry.geodesy import Ellipsoid as Ellipsoid
from .geometry.latlon_grid import LatLonGrid as LatLonGrid
from .geometry.rays import Rays as Rays
from .geometry.shells import Shell as Shell
from .image.render import (
    Image as Image,
)
from .image.render import (
    Prepared as Prepared,
)
from .image.render import (
    Weather as Weather,
)
from .image.render import (
    prepare as prepare,
)
from .image.render import (
    render as render,
)
from .image.render import (
    sample_rays as sample_rays,
)
from .light.bands import Band as Band
from .light.bands import EmissiveBands as EmissiveBands
from .light.bands import ReflectiveBands as ReflectiveBands
from .light.bands import bands_named as bands_named
from .light.bands import nominal_bands as nominal_bands
from .light.emission import EmittingSlabs as EmittingSlabs
from .light.optics import ICE as ICE
from .light.optics import WATER as WATER
from .light.optics import Particles as Particles
from .light.optics import ice as ice
from .light.optics import water as water
from .light.phase import (
    AbstractPhase as AbstractPhase,
)
from .light.phase import (
    CornetteShanks as CornetteShanks,
)
from .light.phase import (
    DoubleHenyeyGreenstein as DoubleHenyeyGreenstein,
)
from .light.phase import (
    HenyeyGreenstein as HenyeyGreenstein,
)
from .light.reflectance import PlaneParallel as PlaneParallel
from .light.reflection import AbstractReflection as AbstractReflection
from .light.reflection import Illumination as Illumination
from .light.reflection import Scatterers as Scatterers
from .light.reflection import Slabs as Slabs
from .light.reflection import TwoFlux as TwoFlux
from .march.layer import class_layer as class_layer
from .march.radiances import (
    CloudProducts as CloudProducts,
)
from .march.radiances import (
    products as products,
)
from .march.radiances import (
    radiances as radiances,
)
from .march.scene import (
    BandRadiances as BandRadiances,
)
from .march.scene import (
    Layer as Layer,
)
from .march.scene import (
    Sampled as Sampled,
)
from .march.scene import (
    Scene as Scene,
)
from .march.scene import (
    View as View,
)
from .march.scene import (
    navigate as navigate,
)
from .march.scene import (
    sample as sample,
)
from .march.shadows import Shadows as Shadows
from .parameters import paths as paths
from .parameters import put as put
from .parameters import value_at as value_at
from .weather.advection import (
    DisplacementMap as DisplacementMap,
)
from .weather.advection import (
    Wind as Wind,
)
from .weather.advection import (
    displace as displace,
)
from .weather.advection import (
    displacement_map as displacement_map,
)
from .weather.advection import (
    propagate as propagate,
)
from .weather.masks import (
    Conditions as Conditions,
)
from .weather.masks import (
    MaskGrid as MaskGrid,
)
from .weather.masks import (
    cloud_fraction as cloud_fraction,
)
from .weather.masks import (
    fraction_to_mask as fraction_to_mask,
)


__version__ = importlib.metadata.version("cloudjax")
