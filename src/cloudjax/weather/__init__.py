"""Where the weather lets clouds stand and how the wind draws them.

Masks from an analysis, winds on the sphere, and displacement by advection.
"""
