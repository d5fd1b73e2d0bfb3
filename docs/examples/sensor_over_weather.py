"""Render a mesoscale sector of GOES-16 over a weather analysis.

Bring the analysis with `cloudjax fetch`, or use any global GFS file.
"""

from datetime import UTC

from cloudjax_scenes.image_strips import render_strips, write_strips
from cloudjax_scenes.sensors import read_sensor
from cloudjax_scenes.weather_scene import open_world


world = open_world(["gfs.grib2"], steps=6)
time = world.series.times[0].replace(tzinfo=UTC)
sensor = read_sensor("abi-meso-10km", centre=(20.0, -80.0))
images = render_strips(world, sensor, sensor.choose([2, 13]), time)
write_strips("meso.nc", images, world)
print(f"meso.nc and meso.png, of {time:%Y-%m-%d %H:%M} UTC")
