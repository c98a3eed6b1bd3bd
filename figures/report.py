"""The report of a reproduction: one Markdown file that a reviewer can read."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from figures import style
from figures.beyond import GATES, OTHERS, losses
from figures.gallery import GALLERY, Drawing, write
from figures.tables import Table
from minisim.errors import FileError
from minisim.files import write_text
from minisim.version import __version__
from scenarios.studies.archive import Archive, MissingRunsError, make_command, smoke_test
from scenarios.studies.cells import saturated, too_short
from scenarios.studies.comparison import COLLIDING, SHOWN, compare, discrepancies, labels, score
from scenarios.studies.crossing import METRICS, tried
from scenarios.studies.reproduction import PARTS, Made
from scenarios.studies.results import Results
from scenarios.studies.study import STUDIES, AnyCase

if TYPE_CHECKING:
    import pandas as pd

#: Studies of the paper's grid.
PAPER = ("as-run", "text")

#: Studies in which vehicles misread each other, and collide: their collisions have a figure.
MISREAD = ("perception", "confidence")

#: Section -> names of figures and tables, in their order; the rest stays in the folder.
SECTIONS = {
    "The paper's figures": (
        "waiting-balanced", "travel-balanced", "waiting-4321", "travel-4321", "waiting-4141",
        "travel-4141", "waiting-arms", "travel-arms",
    ),
    "The paper's tables": ("lanes", "webster", "harmony-4way"),
    "When does DIM lose, and how far does the harmonious gate move it?": (
        "fair", "losses", "losses-table", "gate",
    ),
    "Capacity": ("capacity", "capacity-table"),
    "Fairness": ("fairness",),
    "Human drivers": ("humans",),
    "Wrong perception": (
        "perception", "perception-monitored", "perception-table", "confidence",
    ),
    "Schematic figures": ("maps", "decision-4way", "worst-case"),
}  # fmt: skip

Progress = Callable[[int, int], None]


def write_report(
    archive: Archive,
    made: Sequence[Made],
    jobs: int,
    folder: Path,
    pictures: Path,
    progress: Progress,
    *,
    parts: Collection[str] = PARTS,
) -> int:
    """Draw into `pictures`, then write `folder`/report.md.

    Args:
        archive: of the runs.
        made: what was run, and what failed.
        jobs: processes used.
        folder: of the report.
        pictures: a folder inside it.
        progress: of drawing.
        parts: what to report on: all, or only what is drawn from these studies.

    Returns:
        The number of figures and tables.

    Raises:
        FileError: something cannot be written.
    """
    drawn: dict[str, Drawing] = {}
    missing: dict[str, str] = {}
    whole = set(parts) >= set(PARTS)
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
    try:
        inside = pictures.relative_to(folder).as_posix()
    except ValueError as error:
        raise FileError(f"{pictures} is not inside {folder}") from error
    text = "\n\n".join(_report(archive, made, jobs, drawn, missing, inside, parts))
    write_text(folder / "report.md", text.rstrip() + "\n")
    return len(drawn)


def _report(
    archive: Archive, made: Sequence[Made], jobs: int, drawn: dict[str, Drawing],
    missing: dict[str, str], folder: str, parts: Collection[str],
) -> Iterator[str]:  # fmt: skip
    effort = archive.effort
    studies = [archive.study(name) for name in STUDIES if name in parts]
    yield "# The paper's experiments, reproduced"
    yield (
        f"minisim {__version__}; the seeds 1 … {effort.seeds}, {effort.horizon:g} s a run, "
        f"{jobs} {'process' if jobs == 1 else 'processes'}. Every controller of a cell gets the "
        "same arrivals, but in `as-run`, where some met another inflow than their label says. "
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
    verdict = [*_verdict(archive, parts)]
    if verdict:
        yield "## Result in short"
        yield from verdict
    for heading, names in SECTIONS.items():
        shown = [name for name in names if name in drawn or name in missing]
        if shown:
            yield f"## {heading}"
        for name in shown:
            if name in drawn:
                yield _shown(name, drawn[name], folder)
            else:
                yield f"*{GALLERY[name].title}: {missing[name]}.*"
    if not set(parts).isdisjoint(PAPER):
        yield "## The paper's values and ours, cell by cell"
        for study in PAPER:
            table = drawn.get(f"comparison-{study}")
            if isinstance(table, Table):
                yield table.markdown()
        yield "## Causes of the differences"
        yield _causes(archive)
    yield "## Collisions"
    yield _collisions(results for results in studies if results.study.name not in MISREAD)
    yield "## Over-saturated cells"
    yield _saturated(studies)
    yield "## Failed runs"
    yield _failed(made)


def _made_table(made: Sequence[Made]) -> Table:
    questions = {name: study.question for name, study in STUDIES.items()}
    questions["capacity"] = "Which demand is served without a growing queue?"
    rows = [
        (part.name, questions[part.name], f"{part.runs}", f"{part.hours:.1f}", f"{part.computed}",
         f"{part.wall_s:.0f}", f"{part.cpu_s:.0f}", f"{len(part.failed)}")
        for part in made
    ]  # fmt: skip
    rows.append((
        "all", "", f"{sum(p.runs for p in made)}", f"{sum(p.hours for p in made):.1f}",
        f"{sum(p.computed for p in made)}", f"{sum(p.wall_s for p in made):.0f}",
        f"{sum(p.cpu_s for p in made):.0f}",
        f"{sum(len(p.failed) for p in made)}",
    ))  # fmt: skip
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
            "vehicle, one limit for all. Wall is of what was computed now, drawing not counted; "
            "CPU is of all runs, whenever made, and a run that two studies share counts in both.",
        ),
    )  # fmt: skip


def _cost_table(studies: Iterable[Results]) -> Table:
    """CPU seconds a simulated hour by controller and study."""
    found = [results for results in studies if not results.good.empty]
    series = list(dict.fromkeys(case.series for results in found for case in results.study.cases))
    rows = []
    for name in series:
        cells = [results.good[results.good["series"] == name] for results in found]
        rows.append((style.look(name).label, *map(_cost, cells)))
    return Table(
        "CPU seconds for one simulated hour, mean of the runs",
        ("controller", *(results.study.name for results in found)), tuple(rows),
    )  # fmt: skip


def _cost(rows: pd.DataFrame) -> str:
    if rows.empty:
        return "–"
    hours = float(rows["horizon_s"].astype(float).sum()) / 3600.0
    return f"{float(rows['cpu_s'].astype(float).sum()) / hours:.2f}"


def _verdict(archive: Archive, parts: Collection[str]) -> Iterator[str]:
    judged = [study for study in PAPER if study in parts]
    if judged:
        yield _inside(archive, judged)
    if "fair" in parts:
        yield _gates(archive)


def _inside(archive: Archive, judged: Iterable[str]) -> str:
    """How many of the paper's values lie inside our intervals, by study and controller."""
    smoke = smoke_test(archive.effort)
    lines = []
    for study in judged:
        results = archive.study(study)
        if results.good.empty:
            lines.append(f"- `{study}`: not run (`{make_command(archive.effort, study)}`).")
            continue
        table = compare(results.good)
        lines.append(
            f"- `{study}`: {smoke}{score(table)} comparable values of the paper lie inside our "
            f"95 % prediction interval; of those that are not comparable, "
            f"{score(table, comparable=False)}."
        )
        by = [
            f"{style.look(str(name)).label} {score(part)}"
            for name, part in table.groupby("series", sort=False)
            if score(part).judged
        ]
        lines.append(f"  By controller: {', '.join(by)}.")
    lines.append(
        "- Inside says that one more run of ours could well give the paper's value; where our runs "
        "spread widely, near saturation, nearly every value is inside."
    )
    return "\n".join(lines)


def _gates(archive: Archive) -> str:
    """The question that the paper leaves open, answered in sentences."""
    try:
        found = losses(archive)
    except MissingRunsError as error:
        return f"From which demand on DIM loses is not known: {error}."
    low, high = tried(found.values())
    return "\n".join([
        "Demands at which DIM does worse than each, veh/h/lane on four arms, paper's gate → "
        "harmonious gate; from the first on, with its 95 % interval, to the highest tried "
        f"({high:g}) unless an end is given; \"all\" from the lowest tried ({low:g}) on, in the "
        "mean:\n",
        *(
            f"- {style.look(rival).label}: " + "; ".join(
                f"{name} " + " → ".join(
                    str(found[name, gate, rival]) if (name, gate, rival) in found else "not run"
                    for gate in GATES
                )
                for name in METRICS
            )
            for rival in OTHERS
        ),
    ])  # fmt: skip


def _shown(name: str, drawing: Drawing, folder: str) -> str:
    if isinstance(drawing, Figure):
        title = GALLERY[name].title
        return f"![{title}]({folder}/{name}.png)\n\n*{title[0].upper()}{title[1:]}.*"
    return drawing.markdown()


def _causes(archive: Archive) -> str:
    """The known discrepancies, each once: where it holds, and what shows it."""
    found: dict[tuple[int, str], list[str]] = {}
    for known in sorted(discrepancies()):
        where = ", ".join(
            text
            for text in (
                style.look(known.series).label if known.series else "every controller",
                f"{known.arms} arms" if known.arms else "",
                known.split,
                f"{known.density} veh/h/lane" if known.density else "",
                known.metric.removesuffix("_time_s"),
                f"study {known.study} only" if known.study else "",
            )
            if text
        )
        found.setdefault((known.number, known.cause), []).append(where)
    listed = "\n".join(
        f"- **{labels()[cause]}** {cause} ({'; '.join(where)}.) "
        + (f"*Shown by {SHOWN[number]}.*" if number in SHOWN else "*Not isolated by a run here.*")
        for (number, cause), where in found.items()
    )
    ran = not archive.study("as-run").good.empty
    return (
        f"{'' if ran else 'The study `as-run` was not run for this report. '}"
        "The numbers are those of the column “causes”. Every cause is an attribution, read from "
        "the authors' code, networks and result files: that it holds for a cell does not mean that "
        "it explains all of the difference. Where a run or a file here shows it, that is named. A "
        "cell that is outside and has no cause is not explained.\n\n" + listed
    )


def _cells(results: Results) -> Iterator[tuple[AnyCase, pd.DataFrame]]:
    for case in results.effort.cases(results.study):
        rows = results.good
        for key, value in case._asdict().items():
            if rows.empty:
                break
            rows = rows[rows[key] == value]
        if not rows.empty:
            yield case, rows


def _collisions(studies: Iterable[Results]) -> str:
    lines = []
    published: dict[str, None] = {}
    for results in studies:
        for case, rows in _cells(results):
            count = int(rows["collisions"].sum())
            if count:
                hours = len(rows) * results.effort.horizon / 3600.0
                what = f"{style.look(case.series).label}, {case.where}, {case.density:g} veh/h/lane"
                lines.append(f"- {results.study.name}: {what}: {count} in {hours:.1f} h")
                if results.study.name == "as-run":
                    published[case.series] = None
    why = [
        f"\nWhy {style.look(name).label} collides as it was run: {COLLIDING[name]} "
        "(docs/fidelity.md, discrepancies)."
        for name in published
        if name in COLLIDING
    ]
    return "\n".join([*lines, *why]) if lines else "None in any run."


def _saturated(studies: Iterable[Results]) -> str:
    lines = []
    short = 0
    for results in studies:
        grown: dict[str, list[str]] = {}
        for case, rows in _cells(results):
            short += too_short(rows)
            if saturated(rows):
                where = f"{style.look(case.series).label}, {case.where}"
                grown.setdefault(where, []).append(f"{case.density:g}")
        lines += [
            f"- {results.study.name}: {where}: {', '.join(densities)} veh/h/lane"
            for where, densities in grown.items()
        ]
    head = (
        "Queues of the junction or of one lane grew more than chance until the end: the means of "
        "these cells depend on the horizon and are no delay that a driver could expect."
    )
    if short:
        lines.append(
            f"- In {short} cells the runs are too short to tell: the roads were still filling."
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
    return "\n".join(lines) if lines else "None."
