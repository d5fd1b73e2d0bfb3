"""Clouds for viewers of X3D: boards that stand for the renderer's own cloud.

`export` writes a folder. Its opacities and colours are those of a march along each of a
few directions of view (`seen_cloud`), shared out among boards (`sections`, `boards`).
"""
