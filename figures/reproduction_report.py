"""The report on a reproduction: one Markdown file for a reviewer."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from figures import style
from figures.gallery import GALLERY, SECTIONS, write
from figures.studies.shared.section import Drawing, Item
from figures.tables import Table
from minisim.errors import plural
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
    """Draw into `folder`/figures, then write `folder`/report.md; return the number of drawings.

    `parts` are studies; unless they are all, the report has only figures that need one of them.
    `progress` is called with the figures done and the total. Raises `FileError`.
    """
    pictures = make_folder(folder / "figures")
    drawn: dict[str, Drawing] = {}
    missing: dict[str, str] = {}
    whole = set(parts) >= set(NAMES)
    chosen = [item for item in GALLERY.values() if whole or set(parts) & set(item.needs)]
    for done, item in enumerate(chosen, start=1):
        try:
            drawing = drawn[item.name] = item.build(archive)
            write(drawing, pictures, item.name)
        except MissingRunsError as error:
            missing[item.name] = str(error)
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
        f"minisim {__version__}; the seeds 1 … {effort.seeds}, {effort.horizon:g} s per run, "
        f"{plural(jobs, 'process', 'processes')}. All controllers of a cell get the "
        "same arrivals, except in `as-run`, where some labels state the wrong inflow. "
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
    verdicts = [it.study.verdict(it) for it in studies if it.study.verdict is not None]
    if verdicts:
        yield "## Summary"
        yield from verdicts
    for section in SECTIONS:
        known = drawn.keys() | missing.keys()
        shown = [item for item in section.items if item.in_report and item.name in known]
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
    def totals(parts: Sequence[Made]) -> tuple[str, ...]:
        wall, cpu = (sum(getattr(part, time) for part in parts) for time in ("wall_s", "cpu_s"))
        return (
            f"{sum(part.runs for part in parts)}", f"{sum(part.hours for part in parts):.1f}",
            f"{sum(part.computed for part in parts)}", f"{wall:.0f}", f"{cpu:.0f}",
            f"{sum(len(part.failed) for part in parts)}",
        )  # fmt: skip

    rows = [(part.name, study_named(part.name).question, *totals([part])) for part in made]
    return Table(
        "Studies; runs already in the store were not repeated",
        ("study", "question", "runs", "simulated h", "computed now", "wall [s]", "CPU [s]",
         "failed"),
        (*rows, ("all", "", *totals(made))), labels=2,
        notes=(
            "`text` is the profile `paper` (40 km/h road, 20 km/h from the red zone on, largest "
            "clique first) and says what the paper's rules give; `as-run` has the profiles "
            "`as_run` and `as_run_signals` (what the authors' code did, step 0.01 s): compare the "
            "published numbers with it; all others are the profile `fair`: one "
            "vehicle, one limit for all. Wall time is that of the runs computed now, without "
            "drawing. CPU time is that of all runs, whenever they were made; a run that two "
            "studies share counts in both.",
        ),
    )  # fmt: skip


def _cost_table(studies: Iterable[Results]) -> Table:
    run = [results for results in studies if not results.good.empty]

    def cost(results: Results, name: str) -> str:
        rows = results.good[results.good["series"] == name]
        cpu, horizon = (float(rows[key].astype(float).sum()) for key in ("cpu_s", "horizon_s"))
        return "–" if rows.empty else f"{3600.0 * cpu / horizon:.2f}"

    series = dict.fromkeys(point.series for results in run for point in results.study.points)
    return Table(
        "CPU seconds for one simulated hour, mean of the runs",
        ("controller", *(results.study.name for results in run)),
        tuple((style.look(name).label, *(cost(results, name) for results in run))
              for name in series),
    )  # fmt: skip


def _shown(item: Item, drawing: Drawing) -> str:
    if isinstance(drawing, Figure):
        caption = item.title[0].upper() + item.title[1:]
        return f"![{item.title}](figures/{item.name}.png)\n\n*{caption}.*"
    return drawing.markdown()


def _cells(results: Results) -> Iterator[tuple[Point, pd.DataFrame]]:
    if not results.good.empty:
        groups = results.good.groupby(list(results.study.points[0]._asdict()))
        for point in results.study.chosen(results.effort):
            key = tuple(point._asdict().values())
            if key in groups.indices:
                yield point, groups.get_group(key)


def _collisions(studies: Iterable[Results]) -> str:
    lines = []
    for results in studies:
        for point, rows in _cells(results):
            if count := int(rows["collisions"].sum()):
                hours = float(rows["horizon_s"].sum()) / 3600.0
                where = f"{style.look(point.series).label}, {point.where}, {point.density:g}"
                where = f"{results.study.name}: {where} veh/h/lane"
                lines.append(f"- {where}: {count} in {hours:.1f} h")
    return "\n".join(lines) or "None in any run."


def _saturated(studies: Iterable[Results]) -> str:
    lines, short = [], 0
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
        "In these cells, queues of the junction or of one lane grew more than by chance up to the "
        "end. Their means depend on the horizon; they are not delays that a driver could expect."
    )
    if short:
        cells = plural(short, "cell")
        lines.append(f"- The runs of {cells} are too short: the roads were still filling.")
    return f"{head}\n\n" + ("\n".join(lines) or "None.")


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
