"""The app of the `minisim` command, to which every command is added."""

from __future__ import annotations

from typing import Annotated

import typer

from minisim.compiling import announce_if_new
from minisim.version import __version__

app = typer.Typer(
    name="minisim",
    help="Simulate an intersection: decentralised vehicles (DIM) beside signals.",
    epilog="Start with [bold]minisim demo[/bold], then [bold]minisim run --help[/bold].",
    add_completion=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"minisim {__version__}")
        raise typer.Exit


#: These commands simulate in any case.
_SIMULATING = (
    "animate", "benchmark", "crossval", "demo", "lab", "optimum", "reproduce", "run", "sweep",
    "train",
)  # fmt: skip


@app.callback()
def _root(
    context: typer.Context,
    version: Annotated[  # noqa: ARG001  # its callback has answered
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    given = context.obj or ()  # from `scenarios.cli.main`
    if context.invoked_subcommand in _SIMULATING and not {"-h", "--help"} & {*given}:
        announce_if_new()
