"""Sources of cloud live here: their contract, fractal and gridded ones, and classes.

A class of cloud is data, in TOML.
"""
