"""Import order: eccodes brings a PROJ of its own, and pyproj crashes after it."""

import contextlib


with contextlib.suppress(ImportError):
    import pyproj  # noqa: F401
