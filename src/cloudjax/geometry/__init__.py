"""This room says where rays run: the ellipsoid, lines of sight, sensors' grids, shells,
paths.

Navigation runs once on the host in float64; what goes to the device are small local
numbers in float32.
"""
