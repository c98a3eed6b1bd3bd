"""Every figure and table by name."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from matplotlib.figure import Figure

from figures.junction import schematic
from figures.studies.shared.section import Drawing, Item, Section
from figures.style import FORMATS, save
from figures.tables import WRITERS, save_table
from minisim.errors import choice
from scenarios.studies import NAMES, module_name

#: Study -> its section, in the order of the studies.
STUDIES: dict[str, Section] = {
    name: import_module(f"figures.studies.{module_name(name)}").SECTION for name in NAMES
}

#: In the order of the report.
SECTIONS = sorted((*STUDIES.values(), schematic.SECTION), key=lambda section: section.appendix)

#: All figures and tables, by name.
GALLERY = {item.name: item for section in SECTIONS for item in section.items}


def item_named(name: str) -> Item:
    """A figure or table by name; `InputError` names the nearest one."""
    return GALLERY[choice("figure", name, GALLERY)]


def write(drawing: Drawing, folder: Path, name: str) -> list[Path]:
    """Write a drawing in all its formats, each whole or not at all; returns the files."""
    if isinstance(drawing, Figure):
        files = [folder / f"{name}.{suffix}" for suffix in FORMATS]
        for file in files:
            save(drawing, file)
    else:
        files = [folder / f"{name}.{suffix}" for suffix in WRITERS]
        for file in files:
            save_table(drawing, file)
    return files
