"""What a user can mend ends in one sentence and exit code 2; bugs keep their trace."""

import sys

import click


BAD_INPUT = 2
INTERRUPTED = 130


class OneSentenceGroup(click.Group):
    """A group of commands that end as the contract of the command line says.

    Commands return their exit code, or None for 0.
    """

    def main(self, *args, standalone_mode: bool = True, **kwargs):
        if not standalone_mode:
            return super().main(*args, standalone_mode=False, **kwargs)
        try:
            code = super().main(*args, standalone_mode=False, **kwargs)
        except click.Abort:
            click.echo("Interrupted: nothing half-written is left.", err=True)
            sys.exit(INTERRUPTED)
        except Exception as error:
            sentence = _sentence(error)
            if sentence is None:
                raise
            click.echo(f"cloudjax: {' '.join(sentence.split())}", err=True)
            sys.exit(BAD_INPUT)
        sys.exit(code or 0)


def _sentence(error: Exception) -> str | None:
    """What to tell the user, or None for a bug."""
    if isinstance(error, click.UsageError):
        command = error.ctx.command_path if error.ctx else "cloudjax"
        message = error.format_message().rstrip(".")
        return f"{message}: see {command} --help."
    if isinstance(error, click.ClickException):
        return error.format_message()
    # Here, because the packages behind it take a second to load.
    from cloudjax_data import DataError

    if isinstance(error, DataError):
        return str(error)
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename} cannot be used ({error.strerror}): check the path."
    return None
