"""`cloudjax` is a differentiable renderer of deterministic, fractal, three-dimensional
clouds.

What `__init__.pyi` lists is imported when it is first asked for, so that the parts
which need no jax (`cloudjax.geometry.fixed_grid`, for one) load none.
"""

import importlib.metadata

import lazy_loader


__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = importlib.metadata.version("cloudjax")
