"""The pages of the site that are read off the code: API, controllers, metrics."""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path

from minisim.files import markdown_table
from minisim.results.metrics import TABLE
from scenarios.controllers import CONTROLLERS, maker_of

#: Packages whose `__all__` is what users import.
PACKAGES = (
    "minisim", "dim", "baselines", "scenarios", "figures",
    "minisim.control", "minisim.counts", "minisim.town", "minisim.sumo",
    "scenarios.crossval", "scenarios.environments", "scenarios.sweep",
)  # fmt: skip


def api(package: str) -> str:
    """The page of a package: every name that it exports, in the order of its `__all__`."""
    names = importlib.import_module(package).__all__
    lines = [f"# `{package}`", "", "```{eval-rst}", f".. currentmodule:: {package}", ""]
    return "\n".join([*lines, *(_directive(package, name) for name in names), "```", ""])


def _directive(package: str, name: str) -> str:
    value = getattr(importlib.import_module(package), name)
    if inspect.isclass(value):
        return f".. autoclass:: {package}.{name}\n   :members:\n"
    if callable(value):
        return f".. autofunction:: {package}.{name}\n"
    return f".. py:data:: {name}\n   :type: {type(value).__name__}\n"


def controllers() -> str:
    """The controllers that `-c` knows, from their table."""
    rows = [(f"`{name}`", _first(maker_of(name))) for name in CONTROLLERS]
    return f"# Controllers\n\n{markdown_table(('name', 'what it does'), rows, words=(0, 1))}\n"


def metrics() -> str:
    """Everything that can be measured, from its table."""
    head = ("name", "unit", "one per", "from", "what it is", "equation and source")
    rows = [(f"`{it.name}`", it.unit, it.per, it.needs, it.meaning, it.equation) for it in TABLE]
    return f"# Metrics\n\n{markdown_table(head, rows, words=range(6))}\n"


def _first(value: object) -> str:
    return (inspect.getdoc(value) or "").split("\n\n")[0].replace("\n", " ")


def pages() -> dict[str, str]:
    """All generated pages by name, without suffix."""
    made = {package: api(package) for package in PACKAGES}
    return made | {"controllers": controllers(), "metrics": metrics()}


def write(folder: Path) -> None:
    """Write the pages; those that have not changed are left alone, so that Sphinx skips them."""
    folder.mkdir(exist_ok=True)
    for name, text in pages().items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
