"""What was proved, as text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.table import Table
from rich.text import Text

from minisim.junction.movements import ARM_NAMES

if TYPE_CHECKING:
    from dim.proofs.modelcheck import Exploration, Lasso
    from dim.proofs.verification import Analysis


def claims_table(name: str, analysis: Analysis) -> Table:
    """Each claim, in how many cases it was tried, and in how many it is false."""
    table = Table(
        box=box.SIMPLE_HEAD,
        title=f"{name}, {analysis.n} arms: all {analysis.cases} cases, order {analysis.order}",
        title_justify="left", title_style="bold",
    )  # fmt: skip
    table.add_column("claim")
    for heading in ("cases", "false"):
        table.add_column(heading, justify="right")
    table.add_column("smallest counterexample")
    for claim in analysis.claims:
        table.add_row(
            claim.statement,
            str(claim.cases),
            Text(str(claim.failures), style="bold green" if claim.holds else "bold red"),
            "" if claim.example is None else " ".join(map(str, claim.example)),
        )
    return table


def analysis_text(analysis: Analysis) -> Text:
    """Sizes, ties and the worst cases."""
    from dim.proofs.verification import most_cliques

    text = Text()
    sizes = "  ".join(f"{size}: {cases}" for size, cases in analysis.sizes.items())
    ties = "  ".join(f"{tied}: {cases}" for tied, cases in analysis.ties.items())
    share = analysis.tied / analysis.cases
    text.append("cases by vehicles that go    ", "dim").append(f"{sizes}\n")
    text.append("cases by largest cliques     ", "dim").append(f"{ties}\n")
    text.append("cases with a tie             ", "dim").append(f"{analysis.tied} ({share:.0%})\n")
    text.append("worst case                   ", "dim").append(
        f"{analysis.most_tied} cliques tie "
        f"(no graph of {analysis.n} nodes has more than {most_cliques(analysis.n)})"
    )
    for size, (first, count) in analysis.worst.items():
        cases = "1 case" if count == 1 else f"{count} cases"
        text.append(f"\n{'':29}of size {size}: {cases}, such as {' '.join(map(str, first))}")
    return text


def protocol_text(name: str, found: Exploration, lassos: Sequence[Lasso | None]) -> Text:
    """Safe, stuck, and who can wait for ever."""
    rules = found.protocol
    text = Text.assemble(
        (f"{name}", "bold"),
        f": commit {rules.commit}, gate {rules.gate}, order {rules.order}, "
        f"priorities {rules.priorities}\n",
        ("states       ", "dim"),
        f"{found.states}, with {found.transitions} transitions",
        "" if found.complete else " up to the nearest unsafe ones",
    )
    text.append("\nsafe         ", "dim")
    if found.unsafe:
        text.append("no", "bold red").append(f": {', '.join(map(str, found.unsafe[0]))}")
        text.append(f"\n{'':13}({len(found.unsafe)} such paths of {len(found.unsafe[0])} events)")
    else:
        text.append("yes", "bold green").append(": movements in conflict are never inside at once")
    text.append("\nlive         ", "dim")
    if found.stuck is not None:
        text.append("no", "bold red").append(f": {', '.join(map(str, found.stuck))}")
    elif found.complete:
        text.append("yes", "bold green").append(": in every state somebody can go on")
    else:
        text.append("not stuck in the states visited")
    for lane, lasso in zip(ARM_NAMES, lassos, strict=False):
        text.append(f"\nlane {lane}       ", "dim")
        if lasso is None:
            text.append("never starves", "green")
        else:
            text.append("starves", "yellow").append(
                f": {', '.join(map(str, lasso.stem))}; then again and again "
                f"{', '.join(map(str, lasso.cycle))}"
            )
    return text
