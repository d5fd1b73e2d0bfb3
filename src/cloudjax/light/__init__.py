"""This room holds light in clouds: bands, optics, reflection and thermal emission.

Strategies for sunlight and for emission are objects of one interface each.
"""
