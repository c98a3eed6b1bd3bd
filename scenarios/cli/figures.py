"""`minisim figures`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from minisim.errors import InputError
from scenarios.cli.shared.app import app
from scenarios.cli.shared.terminal import bar, show


@app.command(
    epilog="A figure of results needs runs in a store; [bold]minisim reproduce[/bold] makes them. "
    "What a figure lacks, its small print says.\n\n"
    "[bold]Examples[/bold]\n\n"
    "minisim figures --list\n\n"
    "minisim figures maps worst-case webster --out figures\n\n"
    "minisim figures --store out/runs.sqlite --out figures"
)
def figures(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME...]", show_default=False,
            help="Which ones; every one that there are runs for by default.",
        ),
    ] = None,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder to write to.")] = (
        Path("out/figures")
    ),
    store: Annotated[
        Path | None,
        typer.Option(metavar="STORE", help="The runs, as made by minisim reproduce or sweep.",
                     show_default=False),
    ] = None,
    seeds: Annotated[
        int | None,
        typer.Option(help="Runs a case to look for: the seeds 1 to this one; 10 by default, 2 with "
                          "--quick.", show_default=False),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Look for the runs of minisim reproduce --quick.")
    ] = False,
    as_list: Annotated[bool, typer.Option("--list", help="List the names and stop.")] = False,
) -> None:  # fmt: skip
    """Draw the paper's figures and tables and those beyond it (PDF, SVG, PNG; MD, CSV, TeX)."""
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
    left = 0
    effort = Effort.of(quick=quick, seeds=seeds)
    wanting = [item.name for item in items if item.needs]
    if store is None and names and wanting:
        raise InputError(
            f"{', '.join(wanting)}: drawn from results; give them with --store "
            "(minisim reproduce makes them)"
        )
    if store is None:
        left = len(wanting)
        items = [item for item in items if not item.needs]
    source = None if store is None else Store(store, create=False)
    try:
        folder = make_folder(out)
        archive = Archive(find_in(source), effort)
        missing = []
        with bar("drawing") as progress:
            for done, item in enumerate(items, start=1):
                try:
                    drawing = item.build(archive)
                except MissingRunsError as error:
                    if names:
                        raise
                    missing.append((item.name, str(error)))
                else:
                    write(drawing, folder, item.name)
                progress(done, len(items))
    finally:
        if source is not None:
            source.close()
    typer.echo(f"wrote {len(items) - len(missing)} figures and tables to {folder}")
    if left:
        typer.echo(f"  not {left} others, which need runs: name a store with --store", err=True)
    for name, why in missing:
        typer.echo(f"  not {name}: {why}", err=True)
