"""Light in clouds: bands, optics of particles, reflection and thermal emission.

Strategies for sunlight and for emission are objects of one interface each.
"""
