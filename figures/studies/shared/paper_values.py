"""The paper's values and ours side by side, in words and numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

#: Study of the paper's grid -> words.
HEADINGS = {"as-run": "as the published runs were made", "text": "as the text prescribes"}

EXPLAINED = (
    "† not the run named in its label (see causes). ↑ queues still grew at the end: the mean "
    "depends on the horizon. Inside: the paper's single run lies within our 95 % prediction "
    "interval; where that is wide, it says little."
)


def marked(row: Mapping[Any, Any]) -> str:
    """The paper's value; with † if it is not from the run that its label names."""
    return f"{row['paper']:.2f}" + ("" if row["comparable"] == "yes" else " †")


def range_words(row: Mapping[Any, Any], *, mean: bool = False) -> str:
    """Our prediction interval, preceded by our mean on request; ↑ if queues were still growing."""
    arrow = " ↑" if row["saturated"] else ""
    words = f"{two_digits(row['low'])} … {two_digits(row['high'])}{arrow}"
    if not mean:
        return words
    return f"{two_digits(row['mean'])} ({words})" if row["seeds"] else "–"


def two_digits(value: object) -> str:
    """A number, or a dash if there is none."""
    return f"{value:.2f}" if isinstance(value, float) and math.isfinite(value) else "–"


def inside(row: Mapping[Any, Any]) -> str:
    """Whether the paper's value lies inside our interval."""
    return "–" if row["inside"] is None else "yes" if row["inside"] else "no"
