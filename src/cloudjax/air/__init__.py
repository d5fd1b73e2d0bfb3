"""This room holds clear air: the standard atmosphere, gases, Rayleigh scattering.

What a band does not need is neither computed nor compiled.
"""
