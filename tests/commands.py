"""The command line within a test's own process."""

from click.testing import CliRunner, Result

from cloudjax_cli import main


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def sentence_of(result: Result) -> str:
    """The one sentence of a run that was refused."""
    assert result.exit_code == 2, result.output
    lines = result.stderr.splitlines()
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("cloudjax: ")
    assert lines[0].endswith(".")
    assert "Traceback" not in result.output
    return lines[0]
