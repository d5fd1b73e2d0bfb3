"""This room says where the weather lets clouds stand, and how the wind draws them out.

Masks from an analysis, winds on the sphere, and displacement by advection.
"""
