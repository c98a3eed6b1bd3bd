"""Every value of the paper beside ours, for both studies of its grid, with the causes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from figures import style
from figures.studies.shared import paper_values as paper
from figures.studies.shared.section import Item, Section
from figures.tables import Table
from scenarios.studies.shared import paper_comparison as grid
from scenarios.studies.shared.archive import Archive, missing_note
from scenarios.studies.shared.study import Results

#: Series -> why its published rules lead to collisions.
COLLIDING = {
    "dim": "the published five-arm table has pairs in harmony, such as c3 and e4, whose ways pass "
           "1.48 m apart, less than a vehicle is wide; and by the published rule a decision may "
           "still take the right of way from a vehicle that can no longer stop",
    "v2ic": "the published conflict matrix is that of right-hand traffic (cause 14)",
}  # fmt: skip

#: Discrepancy -> the run or file here that shows it. The others follow from the authors' files.
SHOWN = {
    2: "as-run beside text, which changes vehicle, speeds and zones all at once",
    9: "the last arrivals of the published trips, last_arrival_s in scenarios/data/reference.csv",
    10: "the published arrivals in scenarios/data/arrivals; as-run has such inflow",
    11: "as-run, which has these greens",
    12: "as-run, which has the actuated signal",
    13: "the published arrivals in scenarios/data/arrivals; as-run has such inflow",
    14: "as-run, which has that matrix: see its collisions",
    15: "as-run, which has these speeds",
}


def comparison_table(results: Results) -> Table:
    """Every value that the paper plots or prints, beside ours."""
    table, study = grid.compare(results.good), results.study.name
    return Table(
        f"The paper's values and ours, {paper.HEADINGS[study]} [s]",
        ("controller", "arms", "inflow", "metric", "veh/h/lane", "paper", "ours", "sd",
         "95 % prediction", "paper inside", "causes"),
        tuple(_compared(row, study) for row in table.to_dict("records")), labels=4,
        notes=(
            f"{missing_note(results)}  Inside: {grid.score(table)} comparable values, "
            f"{grid.score(table, comparable=False)} of the others. {paper.EXPLAINED}",
        ),
    )  # fmt: skip


def _compared(row: Mapping[Any, Any], study: str) -> tuple[str, ...]:
    lane = "" if row["lane"] == "all" else f", lane {row['lane']}"
    return (
        style.look(row["series"]).label, f"{row['arms']}", row["split"],
        row["metric"].removesuffix("_time_s") + lane,
        f"{row['density']:g}", paper.marked(row), paper.two_digits(row["mean"]),
        paper.two_digits(row["sd"]), paper.range_words(row), paper.inside(row),
        " ".join(dict.fromkeys(grid.labels()[known.cause] for known in grid.causes(study, row))),
    )  # fmt: skip


def ending(archive: Archive) -> str:
    """The known causes of differences, each listed once, with where it holds and what shows it."""
    holding: dict[tuple[int, str], list[str]] = {}
    for known in grid.discrepancies():
        holding.setdefault((known.number, known.cause), []).append(_where(known))
    listed = [
        f"- **{grid.labels()[cause]}** {cause} ({'; '.join(where)}.) "
        + (f"*Shown by {SHOWN[number]}.*" if number in SHOWN else "*Not isolated by a run here.*")
        for (number, cause), where in holding.items()
    ]
    rows = archive.study("as-run").good
    ran = "The study `as-run` was not run for this report. " if rows.empty else ""
    collisions = [
        f"\nWhy {style.look(name).label} collides as it was run: {COLLIDING[name]} "
        "(docs/background/fidelity.md, discrepancies)."
        for name in COLLIDING
        if not rows.empty and (rows["collisions"][rows["series"] == name] > 0).any()
    ]
    return "\n".join([
        "## Causes of the differences\n",
        f"{ran}The numbers are those of the column “causes”. Every cause is an attribution, read "
        "from the authors' code, networks and result files; it need not explain all of the "
        "difference. If a run or a file here shows it, the list names it. A cell that is outside "
        "and has no cause is not explained.\n",
        *listed,
        *collisions,
    ])  # fmt: skip


def _where(known: grid.Discrepancy) -> str:
    words = (
        style.look(known.series).label if known.series else "every controller",
        f"{known.arms} arms" if known.arms else "",
        known.split,
        f"{known.density} veh/h/lane" if known.density else "",
        known.metric.removesuffix("_time_s"),
        f"study {known.study} only" if known.study else "",
    )
    return ", ".join(filter(None, words))


SECTION = Section(
    "The paper's values and ours, cell by cell",
    tuple(
        Item(f"comparison-{study}", f"every value of the paper beside ours, {study}",
             comparison_table, (study,))
        for study in paper.HEADINGS
    ),
    ending, appendix=True,
)  # fmt: skip
