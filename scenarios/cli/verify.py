"""`minisim verify`."""

from __future__ import annotations

from collections.abc import Iterable
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
from scenarios.cli.shared.terminal import bar, show, show_json


@app.command(
    epilog="Exit code 1 where a claim is false. 6 arms take about 20 s.\n\n"
    "[bold]Examples[/bold]\n\n"
    "minisim verify four-way\n\n"
    "minisim verify five-way --order lanes --plot verification.png"
)
def verify(
    scenario: ScenarioName,
    order: Order = "size",
    bearings: Bearings = None,
    side: Side = "left",
    profile: ProfileName = "paper",
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw what the cases showed (.png, .pdf or .svg)."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Try every case that a junction can decide: the paper's claims, one by one."""
    from dim import HarmonyMatrix
    from dim.proofs.verification import analyse, most_cliques
    from scenarios.cli.shared.files import check_file

    if plot is not None:
        from figures.style import figure_format

        figure_format(plot)
        check_file(plot)
    what = build_scenario(scenario, bearings, profile=profile, side=side)
    matrix = HarmonyMatrix.from_geometry(what.intersection, what.profile.vehicle)
    with bar("trying all cases") as progress:
        analysis = analyse(matrix, order, progress=progress)
    if plot is not None:
        from figures.junction.all_cases import verification_figure
        from figures.style import save

        save(verification_figure(analysis, what.intersection), plot)
    if as_json:
        show_json({
            "scenario": what.name,
            "arms": analysis.n,
            "order": order,
            "cases": analysis.cases,
            "claims": [
                {
                    "name": claim.name,
                    "statement": claim.statement,
                    "holds": claim.holds,
                    "failures": claim.failures,
                    "smallest_counterexample": _names(claim.example),
                }
                for claim in analysis.claims
            ],
            "cases_by_vehicles_that_go": analysis.sizes,
            "cases_by_cliques_tied": analysis.ties,
            "cases_tied": analysis.tied,
            "most_cliques_tied": analysis.most_tied,
            "most_cliques_possible": most_cliques(analysis.n),
            "worst_cases": [
                {"clique_size": size, "cases": count, "first": _names(first)}
                for size, (first, count) in analysis.worst.items()
            ],
        })  # fmt: skip
    else:
        from scenarios.cli.shared.proof import analysis_text, claims_table

        show(claims_table(what.name, analysis), analysis_text(analysis))
        if plot is not None:
            typer.echo(f"wrote {plot}")
    if not analysis.holds:
        raise typer.Exit(1)


def _names(movements: Iterable[object] | None) -> list[str] | None:
    return None if movements is None else list(map(str, movements))
