"""Rays march through the clouds of a scene, to radiances and cloud products.

These are pure functions of arrays, to be compiled, differentiated and batched.
"""
