"""The `cloudjax` command. Each subcommand imports what it needs when it runs."""

import os

import click

from .demo import demo
from .doctor import doctor
from .errors import OneSentenceGroup
from .fetch import fetch
from .fit import fit
from .info import info
from .particles import particles
from .render import render
from .report import report
from .tradeoff import tradeoff
from .x3d import x3d


@click.group(
    cls=OneSentenceGroup,
    commands=[demo, fetch, info, fit, render, report, tradeoff, particles, x3d, doctor],
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True},
    invoke_without_command=True,
)
@click.version_option(package_name="cloudjax")
@click.option(
    "--compilation-cache",
    metavar="DIR",
    help="Keep compiled functions there for the next time. It is trusted code.",
)
@click.option(
    "--debug",
    is_flag=True,
    help="Show the traceback of a fault of the program, and keep it in no file.",
)
@click.pass_context
def main(context: click.Context, compilation_cache: str | None, debug: bool) -> None:
    """Fit fractal clouds to GOES imagery, render them, and compare radiances.

    A SCENE is a folder with the ABI files of one scan (L1b or CMI), with or without a
    GFS or NAM file and a scene.toml. Exit codes: 0 done, 1 finished but not converged,
    2 bad input, 3 a fault of the program; of several scenes the highest.
    """
    context.ensure_object(dict)["debug"] = debug
    if compilation_cache is not None:
        # Read when a subcommand imports JAX.
        os.environ["JAX_COMPILATION_CACHE_DIR"] = compilation_cache
        os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.3")
    if context.invoked_subcommand is None:
        click.echo(context.get_help())
