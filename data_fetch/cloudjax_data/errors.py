"""The one exception this package raises for input it cannot use."""


class DataError(Exception):
    """A file, a folder or a request for data that cannot be used.

    The message is one sentence that names the file or folder and the remedy:
    the command line prints it and exits with code 2.
    """
