"""The comparison on disk: `crossval.csv` (one row per cell, lane and metric), `crossval.md`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from minisim.errors import plural
from minisim.files import markdown_table, write_table, write_text
from minisim.version import __version__
from scenarios.crossval.cases import Case
from scenarios.crossval.comparison import APART, CLOSE, JUDGED, Divergence, Parting, Row
from scenarios.crossval.results import FEW, HOST_SHARE, HOST_TOLERANCES, Result
from scenarios.statistics import Interval

if TYPE_CHECKING:
    import pandas as pd

CSV, REPORT = "crossval.csv", "crossval.md"

NOTHING: Final = "–"  # in a table


def write_report(
    results: Sequence[Result], folder: Path, command: str, figures: Mapping[str, str]
) -> None:
    """Write both files, each whole or not at all; raises `FileError`.

    `command` reproduces the report; `figures`, already in the folder, are file name -> caption.
    """
    write_table(table(results), folder / CSV)
    write_text(folder / REPORT, markdown(results, command, figures))


def table(results: Sequence[Result]) -> pd.DataFrame:
    """One row per cell, lane and metric; a failed run has a row with its error.

    Columns: controller, scenario, arms, split, density [veh/h], profile, horizon_s, lane, metric;
    host and seed of a failed run; seeds; trips, mean [s], half width of its 95 % interval and
    collisions for each host; `difference` (SUMO − minisim, paired by seed) with its `…_ci95`;
    `ks`; `within`, the share of trips that differ by less than 0.1 s; `published`; `error`.
    """
    import pandas as pd

    return pd.DataFrame([row for result in results for row in _rows(result)])


def markdown(results: Sequence[Result], command: str, figures: Mapping[str, str]) -> str:
    """The whole report as Markdown."""
    versions = sorted({result.sumo for result in results if result.sumo})
    replays = [result for result in results if result.meets_paper("minisim") is not None]
    failures = [
        (result.case.name, host, str(seed), error)
        for result in results
        for host, seed, error in result.failures
    ]
    parts = {
        "Verdict": _verdicts(results),
        **{f"{heading} [s]": _means(results, metric) for metric, heading in JUDGED.items()},
        "Against the paper [s]": _replays(replays) if replays else "",
        "Where the hosts part": _partings(results),
        "Runs that failed": failures
        and markdown_table(("cell", "host", "seed", "error"), failures, words=(0, 1, 3)),
        "Figures": "\n\n".join(f"![{text}]({name})\n\n{text}." for name, text in figures.items()),
        "By lane [s]": _lanes(results),
    }
    return "\n\n".join([
        "# minisim, SUMO and the paper on common arrivals",
        f"minisim {__version__}, {', '.join(versions) or 'SUMO did not run'}. Made by:",
        f"```sh\n{command}\n```",
        *_tolerances(),
        *(f"## {title}\n\n{text}".rstrip() for title, text in parts.items() if text),
    ]) + "\n"  # fmt: skip


def summary(results: Sequence[Result]) -> str:
    """How many cells agree, in one line."""
    verdicts = [agree for result in results if (agree := result.hosts_agree) is not None]
    text = "no cell could be compared"
    if verdicts:
        all_cells = plural(len(verdicts), "cell")
        text = f"{sum(verdicts)} of {all_cells}: both hosts agree within the tolerances"
    for host, name in (("minisim", "minisim"), ("sumo", "SUMO")):
        judged = [met for result in results if (met := result.meets_paper(host)) is not None]
        if judged:
            text += f"; {name} meets the paper in {sum(judged)} of {len(judged)}"
    uncompared = len(results) - len(verdicts)
    if verdicts and uncompared:
        text += f"; {plural(uncompared, 'cell')} could not be compared"
    if few := sum(result.few for result in results):
        text += f"; {plural(few, 'verdict')} over fewer than {FEW} trips"
    failed = sum(len(result.failures) for result in results)
    return text + (f"; {plural(failed, 'run')} failed" if failed else "")


def _rows(result: Result) -> Iterator[dict[str, Any]]:
    case, scenario = result.case, result.case.scenario
    cell = {
        "controller": case.controller, "scenario": scenario.name, "arms": scenario.intersection.n,
        "split": case.split, "density": case.density, "fleet": str(scenario.vehicles),
        "profile": scenario.profile.name,
        "arrivals": "drawn" if case.published is None else "published",
        "horizon_s": scenario.horizon,
    }  # fmt: skip
    for row in result.rows:
        means = {}
        for what in ("minisim", "sumo", "difference"):
            means[what], means[f"{what}_ci95"], _ = getattr(row, what)
        yield {
            **cell, "lane": row.lane, "metric": row.metric, "host": None, "seed": None,
            "seeds": len(result.pairs), "trips_minisim": row.trips[0], "trips_sumo": row.trips[1],
            **means, "ks": row.ks, "within": row.within,
            "collisions_minisim": result.collisions[0], "collisions_sumo": result.collisions[1],
            "published": case.reference(row.metric, row.lane), "error": None,
        }  # fmt: skip
    for failure in result.failures:
        yield {**cell, **failure._asdict()}


def _tolerances() -> tuple[str, ...]:
    most = [f"mean {JUDGED[name].lower()} {limit}" for name, limit in HOST_TOLERANCES.items()]
    return (
        "Means are over the trips that ended before the horizon, as SUMO and the paper count them; "
        "± is half a 95 % interval over seeds; a difference is SUMO − minisim, paired by seed (the "
        "arrivals are the same); KS is the largest distance between the two distributions of a "
        "trip's time (0 the same, 1 apart).",
        "The hosts agree if, with their own car following, they differ by at most: "
        f"{', '.join(most)}; "
        f"with the same car following (`as_run`), if at least {100 * HOST_SHARE:g} % of the "
        f"trips have waiting and travel times within {CLOSE:g} s of each other. A replay meets "
        "the paper when mean waiting is within 10 % of the published number, and mean travel "
        "within 0.5 s (DIM; at 350 veh/h within 3 s), 1 s (V2I-C) or 2 s (signals).",
        f"{NOTHING} means no verdict: no run of a cell succeeded in both hosts, or no trip ended. "
        f"Verdicts over fewer than {FEW} trips are marked: one trip may decide them.",
    )


def _verdicts(results: Sequence[Result]) -> str:
    return markdown_table(
        ("cell", "seeds", "trips", "same trips", "collisions minisim / SUMO", "hosts agree",
         "minisim meets the paper", "SUMO meets the paper"),
        (
            (
                it.case.name, str(len(it.pairs)), _counts(it.trips) if it.rows else NOTHING,
                _share(it.agreement), _counts(it.collisions),
                _yes(it.hosts_agree) + (", few trips" if it.few else ""),
                _yes(it.meets_paper("minisim")), _yes(it.meets_paper("sumo")),
            )
            for it in results
        ),
        words=(0, 5, 6, 7),
    )  # fmt: skip


def _means(results: Sequence[Result], metric: str) -> str:
    rows = ((it.case.name, *_cells(it.case, it.row(metric))) for it in results if it.rows)
    return markdown_table(("cell", "minisim", "SUMO", "difference", "KS", "published"), rows)


def _replays(results: Sequence[Result]) -> str:
    """The table of `docs/background/fidelity.md`."""
    return markdown_table(
        ("controller", "arms", "split", "veh/h/lane",
         "waiting, minisim", "SUMO", "published", "travel, minisim", "SUMO", "published",
         "same", "met"),
        map(_replay, results), words=(0, 2, 11),
    )  # fmt: skip


def _replay(result: Result) -> tuple[str, ...]:
    case, rows = result.case, [result.row(metric) for metric in JUDGED]
    means = [(it.minisim.mean, it.sumo.mean, case.reference(it.metric, "all")) for it in rows]
    return (
        case.controller, str(case.scenario.intersection.n), case.split, f"{case.density:g}",
        *map(_number, chain.from_iterable(means)),
        _share(result.agreement), _yes(result.meets_paper("minisim")),
    )  # fmt: skip


def _lanes(results: Sequence[Result]) -> str:
    rows = [(result.case, row) for result in results for row in result.rows]
    return markdown_table(
        ("cell", "lane", "metric", "trips", "minisim", "SUMO", "difference", "KS", "published"),
        (
            (case.name, row.lane, JUDGED[row.metric].lower(), _counts(row.trips),
             *_cells(case, row))
            for case, row in rows
            if row.lane != "all" and row.metric in JUDGED
        ),
        words=(0, 1, 2),
    )  # fmt: skip


def _cells(case: Case, row: Row) -> tuple[str, ...]:
    means = map(_interval, (row.minisim, row.sumo, row.difference))
    return *means, _number(row.ks, 3), _number(case.reference(row.metric, row.lane))


def _partings(results: Sequence[Result]) -> str:
    same = [result.case.name for result in results if result.rows and result.divergence is None]
    apart = [
        (result.case.name, *_trip(result.divergence), *_moment(result.parting))
        for result in results
        if result.divergence is not None
    ]
    parts = [f"No trip differs: {', '.join(same)}."] if same else []
    if apart:
        parts += [
            "The first trip, in order of demand, whose waiting or travel time differs by more than "
            f"{CLOSE:g} s; and, from half a minute before that vehicle entered the road, the first "
            f"vehicle that is more than {APART:g} m from where the other host has it.",
            markdown_table(
                ("cell", "seed", "first trip that differs", "waiting minisim / SUMO",
                 "travel minisim / SUMO", "first apart", "where minisim / SUMO [m]",
                 "speed minisim / SUMO [m/s]"),
                apart, words=(0, 2, 5),
            ),
        ]  # fmt: skip
    return "\n\n".join(parts)


def _trip(first: Divergence) -> tuple[str, ...]:
    which = f"vehicle {first.vehicle} ({first.movement}), on the road from {first.depart:.2f} s"
    return str(first.seed), which, _both(first.waiting), _both(first.travel)


def _moment(parting: Parting | None) -> tuple[str, ...]:
    if parting is None:
        return NOTHING, NOTHING, NOTHING
    which = f"vehicle {parting.vehicle} ({parting.movement}) at {parting.time:.2f} s"
    return which, _both(parting.positions), _both(parting.speeds)


def _counts(values: tuple[int, int]) -> str:
    return f"{values[0]} / {values[1]}"


def _both(values: tuple[float, float]) -> str:
    return f"{values[0]:.2f} / {values[1]:.2f}"


def _interval(interval: Interval) -> str:
    half = "" if math.isnan(interval.half_width) else f" ± {interval.half_width:.2f}"
    return f"{_number(interval.mean)}{half}"


def _number(value: float | None, digits: int = 2) -> str:
    return NOTHING if value is None or math.isnan(value) else f"{value:.{digits}f}"


def _share(value: float) -> str:
    return NOTHING if math.isnan(value) else f"{100 * value:.1f} %"


def _yes(value: bool | None) -> str:
    return NOTHING if value is None else "yes" if value else "**no**"
