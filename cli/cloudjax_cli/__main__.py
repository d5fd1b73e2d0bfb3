"""`python -m cloudjax_fit.cli`."""

from cloudjax_cli import main


main()
