"""The paper's tables, and its figures as tables, each with the paper's own values beside ours."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from importlib import resources
from typing import TYPE_CHECKING, Any

from baselines import webster, webster_delay
from dim import HarmonyMatrix
from figures import style
from figures.beyond import crossing_rows, losses
from figures.tables import Table
from minisim.junction.movements import ARM_NAMES
from scenarios.library import MAKERS
from scenarios.studies.archive import Archive, missing_note, smoke_test
from scenarios.studies.comparison import causes, compare, labels, score
from scenarios.studies.crossing import tried
from scenarios.studies.study import AnyCase

if TYPE_CHECKING:
    import pandas as pd

HEADINGS = {"as-run": "as the published runs were made", "text": "as the text prescribes"}


def webster_table() -> Table:
    """Green times of the fixed-time signal: ours from Webster's formula, and those printed."""
    file = resources.files("scenarios") / "data" / "webster_table.csv"
    with file.open(encoding="utf-8") as text:
        printed = list(csv.DictReader(text))
    rows = []
    for row in printed:
        rate = float(row["density"])
        timing = webster((rate,) * 4)
        green = timing.greens[0]
        delay = webster_delay(rate, green, timing.cycle)
        rows.append((
            row["density"], row["green_s"], f"{green:.2f}", row["amber_s"], f"{timing.cycle:.2f}",
            f"{timing.flow_ratio:.3f}", f"{timing.saturation[0]:.3f}", f"{delay:.1f}",
        ))  # fmt: skip
    return Table(
        "Green of the fixed-time signal on four arms (Webster 1958)",
        ("veh/h/lane", "paper: green [s]", "ours [s]", "amber [s]", "cycle [s]", "Y", "x",
         "expected delay [s]"),
        tuple(rows),
        notes=(
            "Saturation flow 1500 veh/h, 2 s lost a phase. The paper rounds 5.08 and 7.11, and "
            "prints 19.75 where its own network file and the formula have 19.25. The formula of "
            "its text divides by C0 − L where it must multiply. The delay is Webster's for the "
            "long run; a run of an hour near x = 1 has less.",
        ),
    )  # fmt: skip


def harmony_table(arms: int) -> Table:
    """The harmony matrix: as published, and whether the geometry says the same."""
    site = MAKERS[arms]().site()
    ours = HarmonyMatrix.from_geometry(site.intersection, site.vehicle)
    paper = HarmonyMatrix.paper(arms)
    different = {pair for a, b in ours.disagreements(paper) for pair in ((a, b), (b, a))}
    rows = tuple(
        (str(row), *(
            f"{int(paper[row, column])}{'≠' if (row, column) in different else ''}"
            for column in paper.movements
        ))
        for row in paper.movements
    )  # fmt: skip
    said = (
        "The corridors swept by the vehicles give the same matrix."
        if not different
        else f"≠ marks the {len(different) // 2} pairs where the geometry says otherwise."
    )
    return Table(
        f"Harmony matrix of the {arms}-way junction: 1 harmony, 0 conflict",
        ("", *paper.movements.names), rows, notes=(said,),
    )  # fmt: skip


def lane_table(archive: Archive) -> Table:
    """Mean waiting time by lane under DIM at 350 veh/h/lane: the paper's table and ours.

    Raises:
        MissingRunsError: nothing was run.
    """
    both = archive.need(*HEADINGS)
    tables = {results.study.name: compare(results.good) for results in both}
    rows = []
    for arms in (3, 4, 5):
        for lane in ARM_NAMES[:arms]:
            found = {
                study: _one(table, arms=arms, lane=lane, density=350, series="dim")
                for study, table in tables.items()
            }
            first = found["as-run"]
            rows.append((
                f"{arms}-way", lane, f"{first['paper']:.2f}{_mark(first)}",
                *(text for row in found.values() for text in (_ours(row), _inside(row))),
            ))  # fmt: skip
    return Table(
        "Mean waiting time by lane under DIM at 350 veh/h/lane [s]",
        ("junction", "lane", "paper",
         *(t for name in HEADINGS.values() for t in (name, "paper inside"))),
        tuple(rows), labels=2, notes=(f"{missing_note(both, _in_lanes)}  {_EXPLAINED}",),
    )  # fmt: skip


def comparison_table(archive: Archive, study: str) -> Table:
    """Every value that the paper plots or prints, beside ours.

    Args:
        archive: of the study.
        study: "as-run" or "text".

    Raises:
        MissingRunsError: nothing was run.
    """
    (results,) = archive.need(study)
    table = compare(results.good)
    rows = [_compared(row, study) for row in table.to_dict("records")]
    return Table(
        f"The paper's values and ours, {HEADINGS[study]} [s]",
        ("controller", "arms", "inflow", "metric", "veh/h/lane", "paper", "ours", "sd",
         "95 % prediction", "paper inside", "causes"),
        tuple(rows), labels=4,
        notes=(
            f"{missing_note([results], lambda _: True)}  Inside: {score(table)} comparable values, "
            f"{score(table, comparable=False)} of the others. {_EXPLAINED}",
        ),
    )  # fmt: skip


def loss_table(archive: Archive) -> Table:
    """From which demand on DIM does worse than each rival; errors as `losses`."""
    found = losses(archive)
    low, high = tried(found.values())
    (results,) = archive.need("fair")
    return Table(
        "Demand from which on DIM does worse [veh/h/lane]",
        ("than", "measure", "paper's gate", "95 % interval", "harmonious gate", "95 % interval"),
        tuple(crossing_rows(found)), labels=2,
        notes=(
            f"{missing_note([results], lambda _: True)}  "
            "Four arms, profile fair, complete means; paired differences over common arrivals, "
            f"linear between the demands tried, {low:g} to {high:g}. “a to b”: worse between a and "
            "b only, for beyond the capacity of both their order may turn again. “all”: at every "
            "demand tried, in the mean; “c at the latest” then says that only from c on it is "
            "sure. “never”: at none in the mean; “c at the earliest” says that from c on it may "
            "be.",
        ),
    )  # fmt: skip


def capacity_table(archive: Archive) -> Table:
    """The largest demand served without a growing queue [veh/h/lane].

    Raises:
        MissingRunsError: nothing was run.
    """
    found, _ = archive.capacities()
    search = archive.search
    values = {(c.case.series, c.case.arms): str(c) for c in found}
    series = list(dict.fromkeys(c.case.series for c in found))
    arms = sorted({c.case.arms for c in found})
    return Table(
        "Capacity [veh/h/lane]",
        ("controller", *(f"{n} arms" for n in arms)),
        tuple(
            (style.look(name).label, *(values.get((name, n), "–") for n in arms))
            for name in series
        ),
        notes=(
            f"{smoke_test(archive.effort)}Mean ± 95 % interval over {search.seeds} seeds of "
            f"{search.horizon:g} s, with the {search.step / 2.0:g} veh/h/lane by which the search "
            "rounds; “<” and “>”: every demand tried was too much for a seed, or none was. Served "
            "means that the queue grows by less than 2 % of the arrivals.",
        ),
    )  # fmt: skip


def _in_lanes(case: AnyCase) -> bool:
    """Whether a case belongs to the table of lanes."""
    return case.series == "dim" and case.density == 350.0 and case.where.endswith("balanced")


_EXPLAINED = (
    "† not the run that its label says (see causes). ↑ queues still grew at the end: the mean "
    "depends on the horizon. Inside: the paper's single run lies within our 95 % prediction "
    "interval; where that is wide, it says little."
)


def _one(table: pd.DataFrame, **wanted: object) -> Mapping[Any, Any]:
    for key, value in wanted.items():
        table = table[table[key] == value]
    (row,) = table.to_dict("records")
    return dict(row)


def _compared(row: Mapping[Any, Any], study: str) -> tuple[str, ...]:
    lane = "" if row["lane"] == "all" else f", lane {row['lane']}"
    return (
        style.look(row["series"]).label, f"{row['arms']}", row["split"],
        row["metric"].removesuffix("_time_s") + lane,
        f"{row['density']:g}", f"{row['paper']:.2f}{_mark(row)}", _number(row["mean"]),
        _number(row["sd"]), _range(row), _inside(row),
        " ".join(dict.fromkeys(labels()[known.cause] for known in causes(study, row))),
    )  # fmt: skip


def _mark(row: Mapping[Any, Any]) -> str:
    return "" if row["comparable"] == "yes" else " †"


def _ours(row: Mapping[Any, Any]) -> str:
    return f"{_number(row['mean'])} ({_range(row)})" if row["seeds"] else "–"


def _range(row: Mapping[Any, Any]) -> str:
    arrow = " ↑" if row["saturated"] else ""
    return f"{_number(row['low'])} … {_number(row['high'])}{arrow}"


def _number(value: object) -> str:
    return f"{value:.2f}" if isinstance(value, float) and math.isfinite(value) else "–"


def _inside(row: Mapping[Any, Any]) -> str:
    return "–" if row["inside"] is None else "yes" if row["inside"] else "no"
