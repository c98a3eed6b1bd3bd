"""`minisim counts`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import option


@app.command(
    epilog="Then: minisim run four-way --demand day.toml --horizon 3600 --lane-width 3.5\n\n"
    "A mapping says what a sheet does not say in usual words, such as\n\n"
    "  start = 'begins'\n\n"
    "  arms = \\['North', 'East', 'South', 'West']\n\n"
    "  classes = { 'P&R' = 'bus' }"
)
def counts(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A turning-movement count (CSV).")],
    mapping: Annotated[
        Path | None, option("Columns, arms, classes and turns (TOML).", "FILE", "--mapping", "-m")
    ] = None,
    save: Annotated[Path | None, option("Write the demand and its fleet (.toml).", "FILE")] = None,
    as_json: options.AsJson = False,
) -> None:
    """Read a count of turning movements; say what was understood and what was left out."""
    from minisim.counts import read_counts
    from minisim.demandfile import write_demand
    from minisim.files import check_apart, check_file
    from scenarios.cli.shared.report import count_facts, count_parts
    from scenarios.cli.shared.terminal import show, show_json

    check_apart({"FILE": file, "--mapping": mapping, "--save": save})
    if save is not None:
        check_file(save, ".toml")
    count = read_counts(file, mapping)
    if save is not None:
        write_demand(count.demand, save)
    if as_json:
        show_json(count_facts(count))
        return
    show(*count_parts(count))
    if save is not None:
        typer.echo(f"  wrote {save}")
