from .cloud_rule import CloudRule as CloudRule
from .sensor_band import SensorBand as SensorBand
from .sensor_band import nominal_bands as nominal_bands
from .sensors import Sensor as Sensor
from .sensors import read_sensor as read_sensor
from .surface import Surface as Surface
from .weather_analysis import Analysis as Analysis
