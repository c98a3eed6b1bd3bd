"""`minisim figures`."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from minisim.errors import InputError, plural
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import option
from scenarios.cli.shared.terminal import bar, show


@app.command(
    epilog="A figure of results needs runs in a store; [bold]minisim reproduce[/bold] makes them. "
    "The small print of a figure says which runs it lacks.\n\n"
    "[bold]Examples[/bold]\n\n"
    "minisim figures --list\n\n"
    "minisim figures maps worst-case webster --out figures\n\n"
    "minisim figures --store out/runs.sqlite --out figures"
)
def figures(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME...]", help="Which ones; by default all that have runs."),
    ] = None,
    out: options.Folder = Path("out/figures"),
    store: Annotated[Path | None, option("Of minisim reproduce or sweep.", "STORE")] = None,
    seeds: Annotated[
        int | None,
        option("Runs per case to look for: seeds 1 to this one; 10 by default, 2 with --quick."),
    ] = None,
    quick: Annotated[bool, option("Use runs of reproduce --quick.", None, "--quick")] = False,
    as_list: Annotated[bool, option("List the names and stop.", None, "--list")] = False,
) -> None:
    """Draw the paper's figures and tables, and further ones (PDF, SVG, PNG; MD, CSV, TeX)."""
    from figures.gallery import GALLERY, item_named, write
    from minisim.files import make_folder
    from scenarios.cli.shared.report import gallery_table
    from scenarios.studies.shared.archive import Archive, MissingRunsError, find_in
    from scenarios.studies.shared.effort import Effort
    from scenarios.sweep.store import Store

    if as_list:
        show(gallery_table(GALLERY.values()))
        return
    items = [item_named(name) for name in dict.fromkeys(names or GALLERY)]
    effort = Effort.of(quick=quick, seeds=seeds)
    missing, left = [], [item.name for item in items if item.needs and store is None]
    if names and left:
        need = "drawn from results; give them with --store (minisim reproduce makes them)"
        raise InputError(f"{', '.join(left)}: {need}")
    items = [item for item in items if item.name not in left]
    with nullcontext() if store is None else Store(store, create=False) as source:
        folder = make_folder(out)
        if source is not None and source.outdated:
            typer.echo(f"minisim: {source.outdated}", err=True)
        archive = Archive(find_in(source), effort)
        with bar("drawing") as progress:
            for done, item in enumerate(items, start=1):
                try:
                    write(item.build(archive), folder, item.name)
                except MissingRunsError as error:
                    if names:
                        raise
                    missing.append(f"{item.name}: {error}")
                progress(done, len(items))
    drawn = plural(len(items) - len(missing), "figure or table", "figures and tables")
    typer.echo(f"wrote {drawn} to {folder}")
    if left:
        missing.append(f"{plural(len(left), 'other')}, which need runs: name a store with --store")
    for why in missing:
        typer.echo(f"  not {why}", err=True)
