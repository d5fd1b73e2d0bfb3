"""This package raises one exception for input that it cannot use."""


class DataError(Exception):
    """A file, a folder or a request for data cannot be used.

    The message is one sentence that names the file or folder and the remedy:
    the command line prints it and exits with code 2.
    """
