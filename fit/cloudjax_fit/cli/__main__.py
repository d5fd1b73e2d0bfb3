"""`python -m cloudjax_fit.cli`."""

from . import main


main()
