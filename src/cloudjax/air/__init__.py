"""Clear air: the standard atmosphere, gases, Rayleigh scattering, whole columns.

What a band does not need is neither computed nor compiled.
"""
