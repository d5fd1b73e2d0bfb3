"""Sources of cloud: their contract, fractal and gridded ones, and classes of cloud.

A class of cloud is data, in TOML.
"""
