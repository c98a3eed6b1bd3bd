"""The comparison on disk: `crossval.csv`, one row a cell, lane and metric, and `crossval.md`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from minisim.files import markdown_table, write_table, write_text
from minisim.version import __version__
from scenarios.crossval.cases import Case
from scenarios.crossval.comparison import APART, CLOSE, Divergence, Row
from scenarios.crossval.results import FEW, HOST_SHARE, HOST_TOLERANCES, Film, Result
from scenarios.statistics import Interval

if TYPE_CHECKING:
    import pandas as pd

CSV, REPORT = "crossval.csv", "crossval.md"

#: Metric -> heading of its table.
HEADINGS: Final = {"waiting_time_s": "Waiting time", "travel_time_s": "Travel time"}

#: What a table shows where there is nothing to show.
NOTHING: Final = "–"


def write_report(
    results: Sequence[Result], folder: Path, command: str, figures: Mapping[str, str]
) -> None:
    """Write both files, each whole or not at all.

    Args:
        results: of the comparison.
        folder: where to; the figures are there already.
        command: that makes the report again.
        figures: file name -> caption.

    Raises:
        FileError: a file cannot be written.
    """
    write_table(table(results), folder / CSV)
    write_text(folder / REPORT, markdown(results, command, figures))


def table(results: Sequence[Result]) -> pd.DataFrame:
    """One row a cell, lane and metric; a run that failed is a row with its error.

    Columns: controller, scenario, arms, split, density [veh/h], profile, horizon_s, lane, metric;
    host and seed of a failed run; seeds; trips, mean, half width of its 95 % interval and
    collisions of each host; `difference` (SUMO − minisim, paired by seed) with its `…_ci95`;
    `ks`; `within`, the share of the trips that differ by less than 0.1 s; `published`; `error`.
    Times in seconds.
    """
    import pandas as pd

    rows = [row for result in results for row in _rows(result)]
    return pd.DataFrame(rows, columns=list(dict.fromkeys(key for row in rows for key in row)))


def markdown(results: Sequence[Result], command: str, figures: Mapping[str, str]) -> str:
    """The report: tolerances, tables, where the hosts part, failed runs, figures."""
    versions = sorted({result.sumo for result in results if result.sumo})
    lines = [
        "# minisim, SUMO and the paper on common arrivals",
        "",
        f"minisim {__version__}, {', '.join(versions) or 'SUMO did not run'}. Made by:",
        "",
        f"```sh\n{command}\n```",
        "",
        *_tolerances(),
        "",
        "## Verdict",
        "",
        _verdicts(results),
    ]
    for metric, heading in HEADINGS.items():
        lines += ["", f"## {heading} [s]", "", _means(results, metric)]
    replays = [result for result in results if result.meets_paper("minisim") is not None]
    if replays:
        lines += ["", "## Against the paper [s]", "", _replays(replays)]
    lines += ["", "## Where the hosts part", "", *_partings(results)]
    failures = [
        (result.case.name, failure.host, str(failure.seed), failure.error)
        for result in results
        for failure in result.failures
    ]
    if failures:
        failed = markdown_table(("cell", "host", "seed", "error"), failures, words=(0, 1, 3))
        lines += ["", "## Runs that failed", "", failed]
    lines += ["", "## Figures", ""]
    for name, caption in figures.items():
        lines += [f"![{caption}]({name})", "", f"{caption}.", ""]
    lines += ["## By lane [s]", "", _lanes(results), ""]
    return "\n".join(lines)


def summary(results: Sequence[Result]) -> str:
    """How many cells agree, in one line."""
    verdicts = [result.hosts_agree for result in results if result.hosts_agree is not None]
    text = f"{sum(verdicts)} of {len(verdicts)} cells: both hosts agree within the tolerances"
    if not verdicts:
        text = "no cell could be compared"
    for host, name in (("minisim", "minisim"), ("sumo", "SUMO")):
        judged = [met for result in results if (met := result.meets_paper(host)) is not None]
        if judged:
            text += f"; {name} meets the paper in {sum(judged)} of {len(judged)}"
    uncompared = len(results) - len(verdicts)
    if verdicts and uncompared:
        text += f"; {_counted(uncompared, 'cell')} could not be compared"
    if few := sum(result.few for result in results):
        text += f"; {_counted(few, 'verdict')} over fewer than {FEW} trips"
    failed = sum(len(result.failures) for result in results)
    return text + (f"; {_counted(failed, 'run')} failed" if failed else "")


def _rows(result: Result) -> Iterator[dict[str, Any]]:
    case = result.case
    for row in result.rows:
        yield {
            **_identity(case),
            "lane": row.lane,
            "metric": row.metric,
            "host": None,
            "seed": None,
            "seeds": len(result.pairs),
            "trips_minisim": row.trips[0],
            "trips_sumo": row.trips[1],
            "minisim": row.minisim.mean,
            "minisim_ci95": row.minisim.half_width,
            "sumo": row.sumo.mean,
            "sumo_ci95": row.sumo.half_width,
            "difference": row.difference.mean,
            "difference_ci95": row.difference.half_width,
            "ks": row.ks,
            "within": row.within,
            "collisions_minisim": result.collisions[0],
            "collisions_sumo": result.collisions[1],
            "published": case.reference(row.metric, row.lane),
            "error": None,
        }
    for failure in result.failures:
        yield {**_identity(case), **failure._asdict()}


def _identity(case: Case) -> dict[str, Any]:
    scenario = case.scenario
    return {
        "controller": case.controller,
        "scenario": scenario.name,
        "arms": scenario.intersection.n,
        "split": case.split,
        "density": case.density,
        "profile": scenario.profile.name,
        "arrivals": "drawn" if case.published is None else "published",
        "horizon_s": scenario.horizon,
    }


def _tolerances() -> list[str]:
    hosts = ", ".join(
        f"mean {HEADINGS[metric].lower()} {tolerance}"
        for metric, tolerance in HOST_TOLERANCES.items()
    )
    return [
        "Means are over the trips that ended before the horizon, as SUMO and the paper count them; "
        "± is half a 95 % interval over seeds; a difference is SUMO − minisim, paired by seed (the "
        "arrivals are the same); KS is the largest distance between the two distributions of a "
        "trip's time (0 the same, 1 apart).",
        "",
        f"The hosts agree when, each with its own car following, they differ by at most: {hosts}; "
        f"with the same car following (`as_run`), when at least {100 * HOST_SHARE:g} % of the "
        f"trips have waiting and travel times within {CLOSE:g} s of each other. A replay meets "
        "the paper when mean waiting is within 10 % of the published number, and mean travel "
        "within 0.5 s (DIM; at 350 veh/h within 3 s), 1 s (V2I-C) or 2 s (signals).",
        "",
        f"{NOTHING} is no verdict: no run of the cell ended well in both hosts, or no trip did. "
        f"Verdicts over fewer than {FEW} trips are marked: one trip may decide them.",
    ]


def _verdicts(results: Sequence[Result]) -> str:
    return markdown_table(
        ("cell", "seeds", "trips", "same trips", "collisions minisim / SUMO", "hosts agree",
         "minisim meets the paper", "SUMO meets the paper"),
        (
            (
                result.case.name,
                str(len(result.pairs)),
                " / ".join(map(str, result.trips)) if result.rows else NOTHING,
                _share(result.agreement),
                " / ".join(map(str, result.collisions)),
                _yes(result.hosts_agree) + (", few trips" if result.few else ""),
                _yes(result.meets_paper("minisim")),
                _yes(result.meets_paper("sumo")),
            )
            for result in results
        ),
        words=(0, 5, 6, 7),
    )  # fmt: skip


def _means(results: Sequence[Result], metric: str) -> str:
    return markdown_table(
        ("cell", "minisim", "SUMO", "difference", "KS", "published"),
        (
            (result.case.name, *_cells(result.case, result.row(metric)))
            for result in results
            if result.rows
        ),
    )


def _replays(results: Sequence[Result]) -> str:
    """The table of `docs/fidelity.md`."""
    return markdown_table(
        ("controller", "arms", "split", "veh/h/lane",
         "waiting, minisim", "SUMO", "published", "travel, minisim", "SUMO", "published",
         "same", "met"),
        (
            (
                result.case.controller,
                str(result.case.scenario.intersection.n),
                result.case.split,
                f"{result.case.density:g}",
                *(
                    _number(value)
                    for metric in HEADINGS
                    for row in [result.row(metric)]
                    for value in (
                        row.minisim.mean, row.sumo.mean, result.case.reference(metric, "all")
                    )
                ),
                _share(result.agreement),
                _yes(result.meets_paper("minisim")),
            )
            for result in results
        ),
        words=(0, 2, 11),
    )  # fmt: skip


def _lanes(results: Sequence[Result]) -> str:
    return markdown_table(
        ("cell", "lane", "metric", "trips", "minisim", "SUMO", "difference", "KS", "published"),
        (
            (
                result.case.name,
                row.lane,
                HEADINGS[row.metric].lower(),
                " / ".join(map(str, row.trips)),
                *_cells(result.case, row),
            )
            for result in results
            for row in result.rows
            if row.lane != "all" and row.metric in HEADINGS
        ),
        words=(0, 1, 2),
    )


def _cells(case: Case, row: Row) -> tuple[str, ...]:
    return (
        *map(_interval, (row.minisim, row.sumo, row.difference)),
        _number(row.ks, 3),
        _number(case.reference(row.metric, row.lane)),
    )


def _partings(results: Sequence[Result]) -> list[str]:
    apart = [(result, result.divergence) for result in results if result.divergence is not None]
    same = [result.case.name for result in results if result.rows and result.divergence is None]
    lines = [f"No trip differs: {', '.join(same)}.", ""] if same else []
    if not apart:
        return lines
    return [
        *lines,
        "The first trip, in order of demand, whose waiting or travel time differs by more than "
        f"{CLOSE:g} s; and the first vehicle, from half a minute before it came on the road on, "
        f"that is more than {APART:g} m from where the other host has it.",
        "",
        markdown_table(
            ("cell", "seed", "first trip that differs", "waiting minisim / SUMO",
             "travel minisim / SUMO", "first apart", "where minisim / SUMO [m]",
             "speed minisim / SUMO [m/s]"),
            ((result.case.name, *_parting(found, result.film)) for result, found in apart),
            words=(0, 2, 5),
        ),
    ]  # fmt: skip


def _parting(found: Divergence, film: Film | None) -> tuple[str, ...]:
    first = (
        str(found.seed),
        f"vehicle {found.vehicle} ({found.movement}), on the road from {found.depart:.2f} s",
        f"{found.waiting[0]:.2f} / {found.waiting[1]:.2f}",
        f"{found.travel[0]:.2f} / {found.travel[1]:.2f}",
    )
    if film is None or (parting := film.parting) is None:
        return *first, NOTHING, NOTHING, NOTHING
    return (
        *first,
        f"vehicle {parting.vehicle} ({film.movement}) at {parting.time:.2f} s",
        f"{parting.positions[0]:.2f} / {parting.positions[1]:.2f}",
        f"{parting.speeds[0]:.2f} / {parting.speeds[1]:.2f}",
    )


def _interval(interval: Interval) -> str:
    half = "" if math.isnan(interval.half_width) else f" ± {interval.half_width:.2f}"
    return f"{_number(interval.mean)}{half}"


def _number(value: float | None, digits: int = 2) -> str:
    return NOTHING if value is None or math.isnan(value) else f"{value:.{digits}f}"


def _share(value: float) -> str:
    return NOTHING if math.isnan(value) else f"{100 * value:.1f} %"


def _counted(count: int, thing: str) -> str:
    return f"{count} {thing}{'' if count == 1 else 's'}"


def _yes(value: bool | None) -> str:
    return NOTHING if value is None else "yes" if value else "**no**"
