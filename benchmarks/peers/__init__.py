"""The paper's algorithm as users of other tools would write it, and cloudjax itself.

Each module has `prepare`, which makes of the common input a function that renders all
rays once and returns their reflectance factors as a numpy array.
"""
