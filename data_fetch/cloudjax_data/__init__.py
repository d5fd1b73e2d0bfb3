"""GOES and GFS files, read into typed scenes. Needs no jax."""

from .abi import AbiBand as AbiBand
from .abi import read_band as read_band
from .calibration import Calibration as Calibration
from .calibration import EmissiveCalibration as EmissiveCalibration
from .calibration import ReflectiveCalibration as ReflectiveCalibration
from .errors import DataError as DataError
from .fixed_grid import GRID_MAPPING as GRID_MAPPING
from .fixed_grid import FixedGrid as FixedGrid
from .fixed_grid import fixed_grid_coordinates as fixed_grid_coordinates
from .lambert import LambertConic as LambertConic
from .scene import AbiScene as AbiScene
from .scene import to_dataset as to_dataset
from .scene_folder import SceneFolder as SceneFolder
from .scene_folder import open_folder as open_folder
from .sun import sun_direction as sun_direction
from .weather import WeatherCube as WeatherCube
from .weather import check_time as check_time
from .weather import read_weather as read_weather
