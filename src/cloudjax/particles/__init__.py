"""Clouds become particles, for viewers and for motion: placed by optical depth, moved
by winds, thinned with distance.

The march renders clouds of columns instead (`cloudjax.clouds`).
"""
