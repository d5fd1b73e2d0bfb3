"""Errors of the renderer that a user can mend, as the one error of bad input."""

import contextlib
from collections.abc import Iterator

from cloudjax.toml_table import TomlError
from cloudjax_data import DataError


@contextlib.contextmanager
def data_errors() -> Iterator[None]:
    """Raise faults of TOML files as `DataError`; also serves as a decorator."""
    try:
        yield
    except TomlError as error:
        raise DataError(str(error)) from error
