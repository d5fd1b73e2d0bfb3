"""`python -m cloudjax_cli`."""

from cloudjax_cli import main


main()
