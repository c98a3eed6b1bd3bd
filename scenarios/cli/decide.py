"""`minisim decide`."""

from __future__ import annotations

from typing import Annotated

import typer

from minisim.errors import InputError, choice
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.proof import Plot, answer, closed, decision_text, junction, names


@app.command(
    epilog="[bold]Example[/bold]\n\nminisim decide five-way a1 b3 c4 d2 e1 --plot decision.png"
)
def decide(
    scenario: options.ScenarioName,
    movements: Annotated[
        list[str],
        typer.Argument(
            metavar="MOVEMENTS...",
            help="What the front vehicle of each lane wants, such as a1 b2 c2 d2: lane a to the "
            "1st exit clockwise, and so on; at most one per lane.",
        ),
    ],
    order: options.Order = "size",
    bearings: options.Bearings = None,
    side: options.Side = None,
    node: options.Node = None,
    profile: options.ProfileName = "paper",
    fleet: options.Fleet = None,
    lane_width: options.LaneWidth = None,
    plot: Plot = None,
    corridor: Annotated[
        str | None, options.option("Show in it what bodies of this type sweep.", "TYPE")
    ] = None,
    as_json: options.AsJson = False,
) -> None:  # fmt: skip
    """Show how DIM decides: graph, cliques, right of way, and why."""
    from dim import Dim, explain

    if corridor is not None and plot is None:
        raise InputError("--corridor needs --plot: it is drawn there")
    what, matrix = junction(
        scenario, bearings, side=side, node=node, profile=profile, fleet=fleet,
        lane_width=lane_width,
    )  # fmt: skip
    if shut := [it for it in movements if it in closed(what)]:
        raise InputError(f"no vehicle may take {shut[0]} at {what.name}")
    explanation = explain(movements, matrix, order)
    if plot is not None:
        from figures.junction.decision import decision_figure
        from figures.style import save
        from minisim.fleet import TYPES

        site = what.site()
        known = {**TYPES, **{it.name: it for it in site.types}}
        body = None if corridor is None else known[choice("vehicle type", corridor, known)]
        if body is not None and body not in site.types:
            decided = ", ".join(it.name for it in site.types)
            typer.echo(f"minisim: decided for {decided}; the corridors are of {corridor}", err=True)
        save(decision_figure(explanation, site, Dim().start(site).plan, body), plot)
    facts = {
        "scenario": what.name,
        "order": order,
        "participants": names(explanation.participants),
        **{k: list(map(names, getattr(explanation, k))) for k in ("edges", "cliques", "tied")},
        "right_of_way": names(explanation.right_of_way),
        "reason": explanation.reason,
    }
    answer(as_json, facts, decision_text(explanation), wrote=plot)
