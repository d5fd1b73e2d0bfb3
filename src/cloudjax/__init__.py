"""A differentiable renderer of deterministic, fractal, three-dimensional clouds."""

import importlib.metadata

from .advection import (
    DisplacementMap as DisplacementMap,
)
from .advection import (
    Wind as Wind,
)
from .advection import (
    displace as displace,
)
from .advection import (
    displacement_map as displacement_map,
)
from .advection import (
    propagate as propagate,
)
from .air import Air as Air
from .atmosphere import (
    AbstractTemperature as AbstractTemperature,
)
from .atmosphere import (
    StandardAtmosphere as StandardAtmosphere,
)
from .atmosphere import (
    TemperatureProfile as TemperatureProfile,
)
from .bands import (
    EmissiveBands as EmissiveBands,
)
from .bands import (
    ReflectiveBands as ReflectiveBands,
)
from .camera import Camera as Camera
from .cloud import (
    FractalCloud as FractalCloud,
)
from .cloud import (
    Latent as Latent,
)
from .cloud_class import ClassTexture as ClassTexture
from .cloud_class import CloudClass as CloudClass
from .cloud_class import cloud_classes as cloud_classes
from .cloud_class import load_classes as load_classes
from .cloud_function import CloudFunction as CloudFunction
from .emission import EmittingSlabs as EmittingSlabs
from .fixed_grid import FixedGrid as FixedGrid
from .footprint import POINT as POINT
from .footprint import Footprint as Footprint
from .geodesy import GRS80 as GRS80
from .geodesy import Ellipsoid as Ellipsoid
from .gridded import GriddedCloud as GriddedCloud
from .imaging import (
    Image as Image,
)
from .imaging import (
    Prepared as Prepared,
)
from .imaging import (
    Weather as Weather,
)
from .imaging import (
    prepare as prepare,
)
from .imaging import (
    render as render,
)
from .imaging import (
    sample_rays as sample_rays,
)
from .latlon_grid import LatLonGrid as LatLonGrid
from .light import AbstractReflection as AbstractReflection
from .light import Illumination as Illumination
from .light import Scatterers as Scatterers
from .light import Slabs as Slabs
from .light import TwoFlux as TwoFlux
from .optics import ICE as ICE
from .optics import WATER as WATER
from .optics import Particles as Particles
from .optics import ice as ice
from .optics import water as water
from .phase import (
    AbstractPhase as AbstractPhase,
)
from .phase import (
    CornetteShanks as CornetteShanks,
)
from .phase import (
    DoubleHenyeyGreenstein as DoubleHenyeyGreenstein,
)
from .phase import (
    HenyeyGreenstein as HenyeyGreenstein,
)
from .rays import Rays as Rays
from .reflectance import PlaneParallel as PlaneParallel
from .scene import (
    BandRadiances as BandRadiances,
)
from .scene import (
    Layer as Layer,
)
from .scene import (
    Sampled as Sampled,
)
from .scene import (
    Scene as Scene,
)
from .scene import (
    View as View,
)
from .scene import (
    navigate as navigate,
)
from .scene import (
    sample as sample,
)
from .shadows import Shadows as Shadows
from .shell import Shell as Shell
from .source import AbstractCloudSource as AbstractCloudSource
from .source import Occupancy as Occupancy
from .source import Slopes as Slopes
from .texture import (
    InvertedWorley as InvertedWorley,
)
from .texture import (
    Perlin as Perlin,
)
from .texture import (
    Texture as Texture,
)
from .texture import (
    make_texture as make_texture,
)
from .transfer import (
    CloudProducts as CloudProducts,
)
from .transfer import (
    products as products,
)
from .transfer import (
    radiances as radiances,
)
from .weather import (
    Conditions as Conditions,
)
from .weather import (
    MaskGrid as MaskGrid,
)
from .weather import (
    cloud_fraction as cloud_fraction,
)
from .weather import (
    fraction_to_mask as fraction_to_mask,
)


__version__ = importlib.metadata.version("cloudjax")
