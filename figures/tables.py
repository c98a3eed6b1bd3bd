"""Tables for readers and for programs: Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

from figures.style import suffix_of
from minisim.errors import InputError
from minisim.files import markdown_table, write_text


@dataclass(frozen=True)
class Table:
    """A table of text cells."""

    title: str  # one line
    headings: tuple[str, ...]  # of the columns; those after the first `labels` hold numbers
    rows: tuple[tuple[str, ...], ...]  # cells as they are printed
    labels: int = 1  # how many columns from the left hold words
    notes: tuple[str, ...] = ()  # small print below

    def __post_init__(self) -> None:
        if any(len(row) != len(self.headings) for row in self.rows):
            raise InputError(f"table {self.title!r}: every row needs {len(self.headings)} cells")

    def markdown(self) -> str:
        """As a Markdown table."""
        table = markdown_table(self.headings, self.rows, range(self.labels))
        notes = "".join(f"\n{note}\n" for note in self.notes)
        return f"**{self.title}**\n\n{table}\n{notes}"

    def csv(self) -> str:
        """As CSV, without notes."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([self.headings, *self.rows])
        return text.getvalue()

    def latex(self) -> str:
        """As a LaTeX `table` with booktabs rules."""
        columns = "l" * self.labels + "r" * (len(self.headings) - self.labels)
        lines = [
            r"\begin{table}", rf"\caption{{{_latex(self.title)}}}", r"\centering",
            rf"\begin{{tabular}}{{{columns}}}", r"\toprule", _latex_row(self.headings), r"\midrule",
            *map(_latex_row, self.rows), r"\bottomrule", r"\end{tabular}",
            *(rf"\par\footnotesize {_latex(note)}" for note in self.notes), r"\end{table}", "",
        ]  # fmt: skip
        return "\n".join(lines)


#: Suffix -> writer.
WRITERS = {"md": Table.markdown, "csv": Table.csv, "tex": Table.latex}


def save_table(table: Table, path: Path) -> None:
    """Write a table in the format of its suffix (`WRITERS`), whole or not at all."""
    write_text(path, WRITERS[suffix_of(path, "a table", WRITERS)](table))


_LATEX = str.maketrans({
    "&": r"\&", "%": r"\%", "#": r"\#", "_": r"\_", "±": r"$\pm$", "–": "--", "…": r"\dots{}",
    "≥": r"$\geq$", "≤": r"$\leq$", "×": r"$\times$", "²": r"$^2$", "●": r"$\bullet$",
    "·": r"$\cdot$", "↑": r"$\uparrow$", "†": r"$\dagger$", "−": r"$-$",
})  # fmt: skip


def _latex(text: str) -> str:
    return text.translate(_LATEX)


def _latex_row(cells: tuple[str, ...]) -> str:
    return " & ".join(map(_latex, cells)) + r" \\"
