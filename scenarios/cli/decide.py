"""`minisim decide`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import (
    AsJson,
    Bearings,
    Order,
    ProfileName,
    ScenarioName,
    Side,
    build_scenario,
)
from scenarios.cli.shared.terminal import show, show_json


@app.command(
    epilog="[bold]Examples[/bold]\n\n"
    "minisim decide four-way a1 b2 c2 d2\n\n"
    "minisim decide five-way a1 b3 c4 d2 e1 --plot decision.png"
)
def decide(
    scenario: ScenarioName,
    movements: Annotated[
        list[str],
        typer.Argument(
            metavar="MOVEMENTS...", show_default=False,
            help="What the front vehicle of each lane wants, such as a1 b2 c2 d2: lane a to the "
            "1st exit clockwise, and so on; at most one a lane.",
        ),
    ],
    order: Order = "size",
    bearings: Bearings = None,
    side: Side = "left",
    profile: ProfileName = "paper",
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Draw junction and harmony graph (.png, .pdf or .svg)."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Show how DIM decides: graph, cliques, right of way, and why."""
    from dim import Dim, HarmonyMatrix, explain
    from minisim.files import check_file

    if plot is not None:
        from figures.style import figure_format

        figure_format(plot)
        check_file(plot)
    what = build_scenario(scenario, bearings, profile=profile, side=side)
    site = what.site()
    matrix = HarmonyMatrix.from_geometry(site.intersection, site.vehicle)
    explanation = explain(movements, matrix, order)
    if plot is not None:
        from figures.junction.decision import decision_figure
        from figures.style import save

        save(decision_figure(explanation, site, Dim().start(site).plan), plot)
    if as_json:
        show_json({
            "scenario": what.name,
            "order": order,
            "participants": list(map(str, explanation.participants)),
            "edges": [[str(a), str(b)] for a, b in explanation.edges],
            "cliques": [list(map(str, clique)) for clique in explanation.cliques],
            "tied": [list(map(str, clique)) for clique in explanation.tied],
            "right_of_way": list(map(str, explanation.right_of_way)),
            "reason": explanation.reason,
        })  # fmt: skip
        return
    from scenarios.cli.shared.report import decision_text

    show(decision_text(explanation))
    if plot is not None:
        typer.echo(f"wrote {plot}")
