"""`minisim harmony`."""

from __future__ import annotations

from typing import Annotated

import typer

from minisim.errors import InputError
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import (
    AsJson,
    Bearings,
    ProfileName,
    ScenarioName,
    Side,
    build_scenario,
)
from scenarios.cli.shared.terminal import show, show_json


@app.command(
    epilog="A movement is a lane and an exit: c2 comes from lane c and leaves by the 2nd exit "
    "clockwise.\n\n[bold]Example[/bold]\n\nminisim harmony custom --bearings 0,80,190,260 --csv"
)
def harmony(
    scenario: ScenarioName,
    bearings: Bearings = None,
    side: Side = "left",
    profile: ProfileName = "paper",
    clearance: Annotated[
        float | None,
        typer.Option(
            metavar="M", help="Room between the ways of two bodies in metres; 0.5 by default."
        ),
    ] = None,
    csv: Annotated[bool, typer.Option("--csv", help="Print the matrix as CSV.")] = False,
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Print which movements can be driven at once: the harmony matrix."""
    from dim import HarmonyMatrix
    from minisim.junction.conflicts import CLEARANCE

    if csv and as_json:
        raise InputError("--csv and --json exclude each other; give one")
    what = build_scenario(scenario, bearings, profile=profile, side=side)
    room = CLEARANCE if clearance is None else clearance
    matrix = HarmonyMatrix.from_geometry(what.intersection, what.profile.vehicle, room)
    if csv:
        typer.echo(matrix.to_text(), nl=False)
    elif as_json:
        show_json({
            "scenario": what.name,
            "side": side,
            "clearance_m": room,
            "movements": list(matrix.movements.names),
            "harmony": matrix.values.astype(int).tolist(),
        })  # fmt: skip
    else:
        from rich.text import Text

        from scenarios.cli.shared.report import harmony_table

        title = Text(f"{what.name}, {side}-hand traffic: ● harmony, · conflict")
        show(title, harmony_table(matrix))
