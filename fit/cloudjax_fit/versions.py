"""What the numbers of a fit depend on besides its settings and its scene."""

import importlib.metadata


def versions() -> dict[str, str]:
    """Return the versions of the packages that a fit's numbers depend on."""
    names = ("cloudjax", "jax", "jaxlib", "equinox", "optimistix", "numpy")
    return {name: importlib.metadata.version(name) for name in names}
