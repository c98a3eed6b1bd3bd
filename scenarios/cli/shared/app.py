"""The app of the `minisim` command, to which each command is added."""

from __future__ import annotations

from typing import Annotated

import typer

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


@app.callback()
def _root(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    pass
