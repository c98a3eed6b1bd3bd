"""The report of a reproduction: one Markdown file for a reviewer."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from figures import style
from figures.gallery import GALLERY, SECTIONS, STUDIES, write
from figures.studies.shared.section import Drawing, Item
from figures.tables import Table
from minisim.files import make_folder, write_text
from minisim.version import __version__
from scenarios.studies import NAMES, study_named
from scenarios.studies.shared.archive import Archive, MissingRunsError
from scenarios.studies.shared.points import Point
from scenarios.studies.shared.reproduction import Made
from scenarios.studies.shared.study import Results
from scenarios.sweep.cells import saturated, too_short


def write_report(
    archive: Archive, made: Sequence[Made], jobs: int, folder: Path,
    progress: Callable[[int, int], None], *, parts: Collection[str] = NAMES,
) -> int:  # fmt: skip
    """Draw into `folder`/figures, then write `folder`/report.md.

    Args:
        archive: of the runs.
        made: the studies that were run.
        jobs: processes used.
        folder: of the report.
        progress: called with the figures drawn and their number.
        parts: studies; unless they are all, the report has only figures that need one of them.

    Returns:
        The number of figures and tables.

    Raises:
        FileError: something cannot be written.
    """
    pictures = make_folder(folder / "figures")
    drawn: dict[str, Drawing] = {}
    missing: dict[str, str] = {}
    whole = set(parts) >= set(NAMES)
    chosen = {
        name: item
        for name, item in GALLERY.items()
        if whole or not set(parts).isdisjoint(item.needs)
    }
    for done, (name, item) in enumerate(chosen.items(), start=1):
        try:
            drawn[name] = item.build(archive)
        except MissingRunsError as error:
            missing[name] = str(error)
        else:
            write(drawn[name], pictures, name)
        progress(done, len(chosen))
    text = "\n\n".join(_report(archive, made, jobs, drawn, missing, parts))
    write_text(folder / "report.md", text.rstrip() + "\n")
    return len(drawn)


def _report(
    archive: Archive, made: Sequence[Made], jobs: int, drawn: dict[str, Drawing],
    missing: dict[str, str], parts: Collection[str],
) -> Iterator[str]:  # fmt: skip
    effort = archive.effort
    studies = [archive.study(name) for name in NAMES if name in parts]
    yield "# The paper's experiments, reproduced"
    yield (
        f"minisim {__version__}; the seeds 1 … {effort.seeds}, {effort.horizon:g} s a run, "
        f"{jobs} {'process' if jobs == 1 else 'processes'}. All controllers of a cell get the "
        "same arrivals, except in `as-run`, where some met another inflow than their label says. "
        "Intervals are 95 %, Student's t over seeds."
    )
    if effort.densities is not None:
        yield (
            "**A smoke test: few demands and short runs, during which the roads are still "
            "filling. Its numbers mean nothing.**"
        )
    yield "## What was run"
    yield _made_table(made).markdown()
    yield _cost_table(studies).markdown()
    answers = [
        section.answer(archive.study(name))
        for name, section in STUDIES.items()
        if name in parts and section.answer is not None
    ]
    if answers:
        yield "## Result in short"
        yield from answers
    for section in SECTIONS:
        known = [item for item in section.items if item.name in drawn or item.name in missing]
        shown = [item for item in known if item.in_report]
        if shown:
            yield f"## {section.heading}"
        for item in shown:
            if item.name in drawn:
                yield _shown(item, drawn[item.name])
            else:
                yield f"*{item.title}: {missing[item.name]}.*"
        if shown and section.ending is not None:
            yield section.ending(archive)
    yield "## Collisions"
    yield _collisions(results for results in studies if not results.study.about_collisions)
    yield "## Over-saturated cells"
    yield _saturated(studies)
    yield "## Failed runs"
    yield _failed(made)


def _made_table(made: Sequence[Made]) -> Table:
    digits = (0, 1, 0, 0, 0, 0)
    counts = [
        (part.runs, part.hours, part.computed, part.wall_s, part.cpu_s, len(part.failed))
        for part in made
    ]
    names = [(part.name, study_named(part.name).question) for part in made]
    totals = tuple(map(sum, zip((0,) * len(digits), *counts, strict=True)))
    rows = [
        (*words, *(f"{value:.{places}f}" for value, places in zip(values, digits, strict=True)))
        for words, values in zip([*names, ("all", "")], [*counts, totals], strict=True)
    ]
    return Table(
        "Studies; what the store had already was not computed again",
        ("study", "question", "runs", "simulated h", "computed now", "wall [s]", "CPU [s]",
         "failed"),
        tuple(rows), labels=2,
        notes=(
            "`text` is the profile `paper` (40 km/h road, 20 km/h from the red zone on, largest "
            "clique first) and says what the paper's rules give; `as-run` are the profiles "
            "`as_run` and `as_run_signals` (what the authors' code did, step 0.01 s) and is what "
            "the published numbers must be compared with; all others are the profile `fair`: one "
            "vehicle, one limit for all. Wall time is that of the runs computed now, without "
            "drawing. CPU time is that of all runs, whenever they were made; a run that two "
            "studies share counts in both.",
        ),
    )  # fmt: skip


def _cost_table(studies: Iterable[Results]) -> Table:
    """CPU seconds a simulated hour by controller and study."""
    run = [results for results in studies if not results.good.empty]
    series = dict.fromkeys(point.series for results in run for point in results.study.points)
    rows = [
        (style.look(name).label, *(_cost(each.good[each.good["series"] == name]) for each in run))
        for name in series
    ]
    return Table(
        "CPU seconds for one simulated hour, mean of the runs",
        ("controller", *(results.study.name for results in run)), tuple(rows),
    )  # fmt: skip


def _cost(rows: pd.DataFrame) -> str:
    if rows.empty:
        return "–"
    hours = float(rows["horizon_s"].astype(float).sum()) / 3600.0
    return f"{float(rows['cpu_s'].astype(float).sum()) / hours:.2f}"


def _shown(item: Item, drawing: Drawing) -> str:
    if isinstance(drawing, Figure):
        caption = item.title[0].upper() + item.title[1:]
        return f"![{item.title}](figures/{item.name}.png)\n\n*{caption}.*"
    return drawing.markdown()


def _cells(results: Results) -> Iterator[tuple[Point, pd.DataFrame]]:
    """Each point that has rows, with its rows."""
    if not results.good.empty:
        groups = results.good.groupby(list(results.study.points[0]._asdict()))
        for point in results.study.chosen(results.effort):
            key = tuple(point._asdict().values())
            if key in groups.indices:
                yield point, groups.get_group(key)


def _collisions(studies: Iterable[Results]) -> str:
    lines = [
        f"- {results.study.name}: {style.look(point.series).label}, {point.where}, "
        f"{point.density:g} veh/h/lane: {count} in "
        f"{len(rows) * results.effort.horizon / 3600.0:.1f} h"
        for results in studies
        for point, rows in _cells(results)
        if (count := int(rows["collisions"].sum()))
    ]
    return "\n".join(lines) or "None in any run."


def _saturated(studies: Iterable[Results]) -> str:
    lines = []
    short = 0
    for results in studies:
        grown: dict[str, list[str]] = {}
        for point, rows in _cells(results):
            short += too_short(rows)
            if saturated(rows):
                where = f"{style.look(point.series).label}, {point.where}"
                grown.setdefault(where, []).append(f"{point.density:g}")
        lines += [
            f"- {results.study.name}: {where}: {', '.join(densities)} veh/h/lane"
            for where, densities in grown.items()
        ]
    head = (
        "In these cells, queues of the junction or of one lane grew more than chance until the "
        "end. Their means depend on the horizon; they are not delays that a driver could expect."
    )
    if short:
        lines.append(
            f"- In {short} cells, the runs are too short to tell: the roads were still filling."
        )
    return f"{head}\n\n" + ("\n".join(lines) if lines else "None.")


def _failed(made: Sequence[Made]) -> str:
    lines = [
        f"- {part.name}: {row['controller']}, {row['scenario']}, {row['density']:g} veh/h/lane, "
        f"seed {row['seed']}: {row['error']}"
        for part in made
        for row in part.failed[:10]
    ]
    more = sum(max(len(part.failed) - 10, 0) for part in made)
    if more:
        lines.append(f"- and {more} more")
    return "\n".join(lines) or "None."
