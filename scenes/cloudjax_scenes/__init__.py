"""What stands before a sensor: scenes from imagery and weather, sensors, ground, files.

Needs the renderer and the reader of data, and knows nothing of fits.

What `__init__.pyi` lists is imported when it is first asked for, so that the command
line starts without jax.
"""

import lazy_loader


__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
