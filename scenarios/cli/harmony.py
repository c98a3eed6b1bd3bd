"""`minisim harmony`."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.text import Text

from minisim.errors import InputError
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.proof import answer, closed, harmony_table, junction


@app.command(
    epilog="A movement is a lane and an exit: c2 comes from lane c and leaves by the 2nd exit "
    "clockwise.\n\n[bold]Example[/bold]\n\nminisim harmony custom --bearings 0,80,190,260 --csv"
)
def harmony(
    scenario: options.ScenarioName,
    bearings: options.Bearings = None,
    side: options.Side = None,
    node: options.Node = None,
    profile: options.ProfileName = "paper",
    fleet: options.Fleet = None,
    lane_width: options.LaneWidth = None,
    clearance: Annotated[
        float | None, options.option("Room between the paths of two bodies; 0.5 by default.", "M")
    ] = None,
    csv: Annotated[bool, typer.Option("--csv", help="Print the matrix as CSV.")] = False,
    as_json: options.AsJson = False,
) -> None:  # fmt: skip
    """Print which movements can be driven together: the harmony matrix."""
    if csv and as_json:
        raise InputError("--csv and --json cannot be combined; give one")
    from minisim.junction.conflicts import CLEARANCE

    clearance = CLEARANCE if clearance is None else clearance
    what, matrix = junction(
        scenario, bearings, clearance, side=side, node=node, profile=profile, fleet=fleet,
        lane_width=lane_width,
    )  # fmt: skip
    if csv:
        typer.echo(matrix.to_text(), nl=False)
        return
    facts = {
        "scenario": what.name,
        "side": what.intersection.side,
        "fleet": str(what.vehicles),
        "clearance_m": clearance,
        "movements": list(matrix.movements.names),
        "closed": closed(what),
        "harmony": matrix.values.astype(int).tolist(),
    }
    title = Text(f"{what.name}, {what.intersection.side}-hand traffic: ● harmony, · conflict")
    if shut := closed(what):
        title.append(f", – closed: no vehicle may take {', '.join(shut)}")
    answer(as_json, facts, title, harmony_table(matrix, shut))
