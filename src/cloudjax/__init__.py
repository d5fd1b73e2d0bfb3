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
from .air.profile_grid import ProfileGrid as ProfileGrid
from .air.profile_grid import TemperatureGrid as TemperatureGrid
from .clouds.classes import ClassTexture as ClassTexture
from .clouds.classes import CloudClass as CloudClass
from .clouds.classes import cloud_classes as cloud_classes
from .clouds.classes import load_classes as load_classes
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
from .geometry.footprint import Footprint as Footprint
from .geometry.footprint import Sampling as Sampling
from .geometry.geodesy import GRS80 as GRS80
from .geometry.geodesy import Ellipsoid as Ellipsoid
from .geometry.geodesy import sun_over as sun_over
from .geometry.latlon_grid import LatLonGrid as LatLonGrid
from .geometry.rays import Rays as Rays
from .geometry.rays import Sensor as Sensor
from .geometry.shells import Shell as Shell
from .image.render import Image as Image
from .image.render import PreparedImage as PreparedImage
from .image.render import prepare as prepare
from .image.render import render as render
from .light.bands import (
    EmissiveBands as EmissiveBands,
)
from .light.bands import (
    ReflectiveBands as ReflectiveBands,
)
from .light.emission import EmittingSlabs as EmittingSlabs
from .light.ground import AbstractGround as AbstractGround
from .light.ground import ClearSky as ClearSky
from .light.ground import UniformGround as UniformGround
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
from .march.products import CloudProducts as CloudProducts
from .march.radiances import products as products
from .march.radiances import radiances as radiances
from .march.radiances import radiances_and_products as radiances_and_products
from .march.scene import BandRadiances as BandRadiances
from .march.scene import Layer as Layer
from .march.scene import Scene as Scene
from .march.shadows import Shadows as Shadows
from .march.view import View as View
from .march.view import look as look
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
from .weather.masks import AbstractMask as AbstractMask
from .weather.masks import (
    Conditions as Conditions,
)
from .weather.masks import DrawnMask as DrawnMask
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
