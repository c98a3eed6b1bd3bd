"""`minisim verify`."""

from __future__ import annotations

import typer

from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.proof import (
    Plot,
    analysis_text,
    answer,
    claims_table,
    closed,
    junction,
    names,
)
from scenarios.cli.shared.terminal import bar


@app.command(
    epilog="Exit code 1 if a claim is false. 6 arms take about 20 s.\n\n"
    "[bold]Example[/bold]\n\nminisim verify five-way --order lanes --plot verification.png"
)
def verify(
    scenario: options.ScenarioName,
    order: options.Order = "size",
    bearings: options.Bearings = None,
    side: options.Side = None,
    node: options.Node = None,
    profile: options.ProfileName = "paper",
    plot: Plot = None,
    as_json: options.AsJson = False,
) -> None:
    """Check the paper's claims one by one, in every case that can occur at a junction."""
    from dim.proofs.verification import analyse, most_cliques

    what, matrix = junction(scenario, bearings, side=side, node=node, profile=profile)
    with bar("trying all cases") as progress:
        analysis = analyse(matrix, order, closed=closed(what), progress=progress)
    if plot is not None:
        from figures.junction.all_cases import verification_figure
        from figures.style import save

        save(verification_figure(analysis, what.intersection), plot)
    facts = {
        "scenario": what.name,
        "arms": analysis.n,
        "order": order,
        "cases": analysis.cases,
        "claims": [
            {
                **{key: getattr(it, key) for key in ("name", "statement", "holds", "failures")},
                "smallest_counterexample": None if it.holds else names(it.example or ()),
            }
            for it in analysis.claims
        ],
        "cases_by_vehicles_that_go": analysis.sizes,
        "cases_by_cliques_tied": analysis.ties,
        "cases_tied": analysis.tied,
        "most_cliques_tied": analysis.most_tied,
        "most_cliques_possible": most_cliques(analysis.n),
        "worst_cases": [
            {"clique_size": size, "cases": count, "first": names(first)}
            for size, (first, count) in analysis.worst.items()
        ],
    }
    table = claims_table(what.name, analysis)
    answer(as_json, facts, table, analysis_text(analysis), wrote=plot)
    if not analysis.holds:
        raise typer.Exit(1)
