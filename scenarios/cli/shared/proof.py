"""Shared by the commands about DIM's rules: the junction, the option --plot, and answers."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.table import Table
from rich.text import Text

from minisim.errors import plural
from minisim.files import check_file
from scenarios.cli.shared.options import build_scenario, option
from scenarios.cli.shared.terminal import show, show_json

if TYPE_CHECKING:
    from dim import Explanation, HarmonyMatrix
    from dim.proofs.modelcheck import Exploration, Lasso
    from dim.proofs.verification import Analysis
    from scenarios.scenario import Scenario


def _check_figure(path: Path | None) -> Path | None:
    if path is not None:
        from figures.style import figure_format

        figure_format(path)
        check_file(path)
    return path


Plot = Annotated[Path | None, option("Draw it (.png, .pdf, .svg).", "FILE", callback=_check_figure)]


def junction(
    name: str, bearings: str | None, clearance: float | None = None, **more: Any
) -> tuple[Scenario, HarmonyMatrix]:
    """A scenario and the harmony matrix of its movements; `more` as in `build_scenario`."""
    from dim import HarmonyMatrix
    from minisim.junction.conflicts import CLEARANCE

    scenario = build_scenario(name, bearings, **more)
    room = CLEARANCE if clearance is None else clearance
    matrix = HarmonyMatrix.from_geometry(scenario.intersection, scenario.vehicles, room)
    return scenario, matrix


def closed(scenario: Scenario) -> list[str]:
    """The movements of a junction that no vehicle may take."""
    junction = scenario.intersection
    return [str(it) for it in compress(junction.movements, ~junction.allowed)]


def answer(
    as_json: bool, facts: Mapping[str, Any], *texts: Text | Table, wrote: Path | None = None
) -> None:
    """Print either the facts as JSON, or the texts and the name of the file written."""
    if as_json:
        show_json(facts)
        return
    show(*texts)
    if wrote is not None:
        typer.echo(f"wrote {wrote}")


def names(things: Iterable[object]) -> list[str]:
    """Movements or events as strings."""
    return list(map(str, things))


def claims_table(name: str, analysis: Analysis) -> Table:
    """Each claim, and the numbers of cases in which it was tested and in which it is false."""
    table = Table(
        box=box.SIMPLE_HEAD,
        title=f"{name}, {analysis.n} arms: all {analysis.cases} cases, order {analysis.order}",
        title_justify="left", title_style="bold",
    )  # fmt: skip
    for heading in ("claim", "cases", "false", "smallest counterexample"):
        table.add_column(heading, justify="right" if heading in ("cases", "false") else "left")
    for claim in analysis.claims:
        failures = Text(str(claim.failures), style="bold green" if claim.holds else "bold red")
        table.add_row(claim.statement, str(claim.cases), failures, _spaced(claim.example or ()))
    return table


def analysis_text(analysis: Analysis) -> Text:
    """Sizes, ties and the worst cases."""
    from dim.proofs.verification import most_cliques

    def counts(cases: Mapping[int, int]) -> str:
        return "  ".join(f"{key}: {count}" for key, count in cases.items()) + "\n"

    text = Text.assemble(
        ("cases by vehicles that go    ", "dim"), counts(analysis.sizes),
        ("cases by largest cliques     ", "dim"), counts(analysis.ties),
        ("cases with a tie             ", "dim"),
        f"{analysis.tied} ({analysis.tied / analysis.cases:.0%})\n",
        ("worst case                   ", "dim"), f"{analysis.most_tied} cliques tie "
        f"(no graph of {analysis.n} nodes has more than {most_cliques(analysis.n)})",
    )  # fmt: skip
    for size, (first, count) in analysis.worst.items():
        text.append(f"\n{'':29}of size {size}: {plural(count, 'case')}, such as {_spaced(first)}")
    return text


def protocol_text(name: str, search: Exploration, lassos: Sequence[Lasso | None]) -> Text:
    """Whether it is safe and live, and which lanes can wait for ever."""
    from minisim.junction.movements import ARM_NAMES

    rules = search.protocol
    text = Text.assemble(
        (name, "bold"),
        f": commit {rules.commit}, gate {rules.gate}, order {rules.order}, "
        f"priorities {rules.priorities}\n",
        ("states       ", "dim"),
        f"{search.states}, with {search.transitions} transitions",
        "" if search.complete else " up to the nearest unsafe ones",
    )
    yes, no = ("yes", "bold green"), ("no", "bold red")
    text.append("\nsafe         ", "dim")
    if search.unsafe:
        first = search.unsafe[0]
        paths = (
            f"\n{'':13}({plural(len(search.unsafe), 'such path')} of {plural(len(first), 'event')})"
        )
        text.append(*no).append(f": {_listed(first)}{paths}")
    else:
        text.append(*yes).append(": movements in conflict are never inside at once")
    text.append("\nlive         ", "dim")
    if search.stuck is not None:
        text.append(*no).append(f": {_listed(search.stuck)}")
    elif search.complete:
        text.append(*yes).append(": in every state a vehicle can go on")
    else:
        text.append("not stuck in the states visited")
    for lane, lasso in zip(ARM_NAMES, lassos, strict=False):
        text.append(f"\nlane {lane}       ", "dim")
        if lasso is None:
            text.append("never starves", "green")
        else:
            stem, cycle = _listed(lasso.stem), _listed(lasso.cycle)
            text.append("starves", "yellow").append(f": {stem}; then again and again {cycle}")
    return text


def harmony_table(matrix: HarmonyMatrix, shut: Collection[str] = ()) -> Table:
    """The matrix with one column per lane: ● harmony, · conflict, – a movement that is `shut`."""
    from minisim.junction.movements import ARM_NAMES

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("")
    manoeuvres = range(1, matrix.n)

    def mark(sign: str, manoeuvre: int) -> Text:
        return Text(f"{sign:<{len(str(manoeuvre)) + 2}}", "green" if sign == "●" else "dim")

    for lane in ARM_NAMES[: matrix.n]:
        table.add_column(" ".join(f"{lane}{j}" for j in manoeuvres), no_wrap=True)
    known = [str(movement) in shut for movement in matrix.movements]
    for movement, values in zip(matrix.movements, matrix.values.tolist(), strict=True):
        signs = [
            "–" if str(movement) in shut or gone else "●" if harmony else "·"
            for gone, harmony in zip(known, values, strict=True)
        ]
        parts = range(0, len(signs), matrix.n - 1)
        cells = [Text("").join(map(mark, signs[first:], manoeuvres)) for first in parts]
        row = Text(str(movement), style="bold"), *cells
        table.add_row(*row, end_section=movement.manoeuvre == matrix.n - 1)
    return table


def decision_text(explanation: Explanation) -> Text:
    """The graph, its cliques, which vehicles go, and why."""
    edges = "  ".join(f"{a}–{b}" for a, b in explanation.edges) or "none"
    text = Text.assemble(
        ("vehicles         ", "dim"), f"{_spaced(explanation.participants)}\n",
        ("in harmony       ", "dim"), f"{edges}\n",
    )  # fmt: skip
    ties = explanation.tied if len(explanation.tied) > 1 else ()
    for k, clique in enumerate(explanation.cliques):
        text.append("maximal cliques  " if k == 0 else " " * 17, "dim")
        text.append(f"{{{_spaced(clique)}}}", "bold" if k == 0 else "")
        text.append("  tied" if clique in ties else "", "yellow")
        text.append("  ← right of way\n" if k == 0 else "\n", "green")
    return text.append_text(Text.assemble(
        ("right of way     ", "dim"), (_spaced(explanation.right_of_way), "bold green"),
        ("\nwhy              ", "dim"), explanation.reason,
    ))  # fmt: skip


def _spaced(things: Iterable[object]) -> str:
    return " ".join(names(things))


def _listed(things: Iterable[object]) -> str:
    return ", ".join(names(things))
