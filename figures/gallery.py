"""Every figure and table by name."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from figures.junction import schematic
from figures.studies.shared.section import Drawing, Item, Section
from figures.style import FORMATS, save
from figures.tables import WRITERS, save_table
from minisim.errors import choice
from scenarios.studies import NAMES, module_name

#: Study -> its section, in the studies' order.
STUDIES: dict[str, Section] = {
    name: import_module(f"figures.studies.{module_name(name)}").SECTION for name in NAMES
}

#: All sections, in the report's order.
SECTIONS = sorted((*STUDIES.values(), schematic.SECTION), key=lambda section: section.appendix)

#: All figures and tables, by name.
GALLERY = {item.name: item for section in SECTIONS for item in section.items}


def item_named(name: str) -> Item:
    """A figure or table by name; if there is none, `InputError` names the closest match."""
    return GALLERY[choice("figure", name, GALLERY)]


def write(drawing: Drawing, folder: Path, name: str) -> list[Path]:
    """Write a drawing in all its formats, each completely or not at all; return the files."""
    writer: Callable[[Any, Path], None] = save if isinstance(drawing, Figure) else save_table
    formats = FORMATS if isinstance(drawing, Figure) else WRITERS
    files = [folder / f"{name}.{suffix}" for suffix in formats]
    for file in files:
        writer(drawing, file)
    return files
