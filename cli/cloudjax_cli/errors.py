"""What a user can mend ends in one sentence and exit code 2, a fault of the program in
one and exit code 3.
"""

import errno
import os
import sys
import tempfile
import traceback

import click

from .streams import forgive_encodings


BAD_INPUT = 2
FAULT = 3
INTERRUPTED = 130
# As of a process that the signal of a closed pipe has ended.
CLOSED_PIPE = 141

# What the machine refuses whatever the path: disk, quota, memory, numbers of files.
_OF_THE_MACHINE = {
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EROFS,
    errno.EIO,
    errno.EMFILE,
    errno.ENFILE,
    errno.ENOMEM,
}


class OneSentenceGroup(click.Group):
    """A group of commands that end as the contract of the command line says.

    Commands return their exit code, or None for 0.
    """

    def main(self, *args, standalone_mode: bool = True, **kwargs):
        if not standalone_mode:
            return super().main(*args, standalone_mode=False, **kwargs)
        forgive_encodings()
        said: dict[str, bool] = {}
        try:
            code = super().main(*args, standalone_mode=False, obj=said, **kwargs)
        except click.Abort:
            click.echo("Interrupted: nothing half-written is left.", err=True)
            sys.exit(INTERRUPTED)
        except Exception as error:
            sentence, code = told(error, debug=said.get("debug", False))
            click.echo(f"cloudjax: {sentence}", err=True)
        sys.exit(code or 0)

    def invoke(self, ctx: click.Context):
        try:
            return super().invoke(ctx)
        except BrokenPipeError:
            # Nobody reads on; what Python still holds back must not fail once more.
            # Left to click this would be exit code 1.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            sys.exit(CLOSED_PIPE)


def told(error: Exception, *, debug: bool = False) -> tuple[str, int]:
    """Return one sentence for an error, and the exit code that goes with it.

    **Arguments:** `debug`: show the traceback of a fault, and keep it in no file.
    """
    sentence, code = _sentence(error), BAD_INPUT
    if sentence is None:
        sentence, code = _of_fault(error, debug=debug), FAULT
    return " ".join(sentence.split()), code


def _sentence(error: Exception) -> str | None:
    """What to tell the user, or None for a fault of the program."""
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
    if isinstance(error, OSError) and error.errno in _OF_THE_MACHINE:
        return f"The machine refuses ({error.strerror}): make room and try again."
    return None


def _of_fault(error: Exception, *, debug: bool) -> str:
    """A sentence that asks for a report, and where the traceback is."""
    trace = "".join(traceback.format_exception(error))
    if debug:
        click.echo(trace, err=True)
        where = "with the traceback above"
    else:
        where = f"with {_kept(trace)}"
    first = (str(error).strip().splitlines() or [""])[0]
    named = f"{type(error).__name__}: {first}" if first else type(error).__name__
    return (
        f"This is a fault of the program and not of its input ({named}): please report "
        f"it {where} and the command that you ran."
    )


def _kept(trace: str) -> str:
    """A file with the traceback, or what to do to see it."""
    try:
        handle, path = tempfile.mkstemp(prefix="cloudjax-fault-", suffix=".txt")
        with open(handle, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write(trace)
    except OSError:
        return "what cloudjax --debug shows of it"
    return path
