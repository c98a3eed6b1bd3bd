"""`minisim junction`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from minisim.errors import InputError, plural
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import option
from scenarios.cli.shared.terminal import bar, show, show_json, wrapped

if TYPE_CHECKING:
    from rich.text import Text

    from minisim.town import Survey

_KMH = 3.6


@app.command(
    epilog="Reads a network of SUMO (.net.xml, perhaps .gz), or an extract of OpenStreetMap, which "
    "netconvert reads (extra sumo). Junctions of 3 or more arms, one lane per direction, can "
    "be simulated.\n\n[bold]Examples[/bold]\n\n"
    "minisim junction town.net.xml --list\n\n"
    "minisim junction town.net.xml --node 252016277 --save junction.toml\n\n"
    "minisim run junction.toml -d 150\n\nminisim run town.net.xml --node 252016277 -d 150"
)
def junction(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A network or an extract.")],
    node: options.Node = None,
    listed: Annotated[bool, option("All nodes, and which can be read.", None, "--list")] = False,
    side: Annotated[str | None, option("Of an extract's traffic: right or left.", "SIDE")] = None,
    save: Annotated[Path | None, option("Write the junction (.toml).", "FILE")] = None,
    as_json: options.AsJson = False,
) -> None:  # fmt: skip
    """Read one junction of a real town."""
    from minisim.errors import choice
    from minisim.files import check_file, write_text
    from minisim.town import survey, survey_of
    from scenarios.junctions import junction_text

    if side is not None:
        choice("side", side, ("left", "right"))
    if listed and (node is not None or save is not None):
        raise InputError("--list is about all nodes; leave out --node and --save")
    if save is not None:
        check_file(save, ".toml")
    if listed:
        with bar("reading"):
            every = survey(file, side)
        if as_json:
            show_json([_facts(it) for it in every])
            return
        show(_every(every))
        typer.echo(_count(every))
        return
    with bar("reading"):
        found = survey_of(file, node, side)
    if as_json:
        show_json(_facts(found) | {"roads": _rows(found)})
    else:
        _tell(found)
    if save is not None and found.intersection is not None:
        write_text(save, junction_text(found.node.id, found.intersection))
        if not as_json:
            typer.echo(f"wrote {save}")


def _facts(found: Survey) -> dict[str, Any]:
    made = found.intersection
    return {
        "node": found.node.id, "type": found.node.kind, "arms": len(found.arms),
        "readable": made is not None, "verdict": found.verdict,
        "misfit_m": None if made is None else round(found.misfit, 3),
    }  # fmt: skip


def _every(every: Sequence[Survey]) -> Text:
    """Each node with its verdict, in lines of 80 columns."""
    from rich.text import Text

    lines = []
    for it in every:
        what = f"{it.node.id}, {it.node.kind}, {plural(len(it.arms), 'arm')}"
        told = f"{'yes' if it.intersection else 'no':3}  {what}: {it.verdict}"
        lines.append(Text(wrapped(told, 5), "" if it.intersection else "dim"))
    return Text("\n").join(lines)


def _count(every: Sequence[Survey]) -> str:
    possible = sum(it.intersection is not None for it in every)
    single = [it for it in every if it.single]
    return (
        f"{possible} of {plural(len(every), 'node')} can be read; {len(single)} "
        f"{'has' if len(single) == 1 else 'have'} 3 or more arms with one lane per direction"
    )


def _rows(found: Survey) -> list[dict[str, Any]]:
    made = found.intersection
    assert made is not None
    names = zip(made.movements.names, made.movements.origins.tolist(), made.allowed, strict=True)
    turns = [(name, origin) for name, origin, allowed in names if allowed]
    return [
        {
            "arm": arm.name, "bearing_deg": arm.bearing, "traffic": road.traffic,
            "length_m": road.length, "limit_kmh": round((road.speed_limit or 0.0) * _KMH, 1),
            "lane_width_m": road.lane_width,
            "turns": [name for name, origin in turns if made.arms[origin] == arm],
            "edges": [edge.id for edge in given.edges], "street": given.main.street,
        }
        for arm, road, given in zip(made.arms, made.roads or (), found.arms, strict=True)
    ]  # fmt: skip


def _tell(found: Survey) -> None:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    made = found.intersection
    assert made is not None
    table, rows = Table(box=box.SIMPLE_HEAD), _rows(found)
    for title in (
        "arm", "bearing [°]", "traffic", "length [m]", "limit [km/h]", "lanes [m]", "turns",
    ):  # fmt: skip
        table.add_column(title, justify="right" if title.endswith("]") else "left")
    for row in rows:
        cells = [" ".join(it) if isinstance(it, list) else it for it in (*row.values(),)[:7]]
        table.add_row(*(f"{it:g}" if isinstance(it, float) else str(it) for it in cells))
    ways = [f"{row['arm']}: {' '.join(row['edges'])} {row['street']}".rstrip() for row in rows]
    what = Text.assemble((f"node {found.node.id}", "bold"), f" ({found.node.kind})")
    what.append(f": {made.side}-hand traffic, junction radius {made.junction_radius:g} m")
    told = [*(f"edges of {way}" for way in ways), *found.verdict.split("; ")]
    show(what, table, *(Text(f"  {wrapped(it, 4)}") for it in told))
