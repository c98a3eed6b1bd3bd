"""Every figure and table by name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType

from matplotlib.figure import Figure

from figures import beyond, misreading, mixing, paper_results, paper_tables
from figures.junction import schematic
from figures.style import FORMATS, save
from figures.tables import WRITERS, Table, save_table
from minisim.errors import choice
from scenarios.studies.archive import Archive

#: What is drawn: a picture, or a table to read.
Drawing = Figure | Table


@dataclass(frozen=True)
class Item:
    """A figure or table that can be made.

    Attributes:
        name: as on the command line, and of its files.
        title: in one line.
        build: makes it from results.
        needs: the studies that it is made from; none for what needs no run.
    """

    name: str
    title: str
    build: Callable[[Archive], Drawing]
    needs: tuple[str, ...] = ()


def _without_runs(build: Callable[[], Drawing], archive: Archive) -> Drawing:  # noqa: ARG001
    return build()


def _results() -> Iterable[Item]:
    both = ("as-run", "text")
    words = {"waiting_time_s": "waiting", "travel_time_s": "travel"}
    splits = {"balanced": "balanced", "4:3:2:1": "4321", "4:1:4:1": "4141"}
    for metric, word in words.items():
        for split, short in splits.items():
            yield Item(
                f"{word}-{short}", f"mean {word} time over demand, inflow {split}, 4 arms",
                partial(paper_results.split_figure, metric=metric, split=split), both,
            )  # fmt: skip
        yield Item(
            f"{word}-arms", f"mean {word} time under DIM on 3, 4 and 5 arms",
            partial(paper_results.arms_figure, metric=metric), both,
        )  # fmt: skip
    yield Item("lanes", "waiting time by lane at 350 veh/h/lane", paper_tables.lane_table, both)
    for study in both:
        yield Item(
            f"comparison-{study}", f"every value of the paper beside ours, {study}",
            partial(paper_tables.comparison_table, study=study), (study,),
        )  # fmt: skip


def _schematic() -> Iterable[Item]:
    for arms in (3, 4, 5):
        yield Item(
            f"decision-{arms}way", f"junction with zones and harmony graph, {arms} arms",
            partial(_without_runs, partial(schematic.decision, arms)),
        )  # fmt: skip
    yield Item(
        "worst-case",
        "the most tied cliques on four arms",
        partial(_without_runs, schematic.worst_case),
    )
    yield Item("maps", "the three junctions from above", partial(_without_runs, schematic.maps))
    yield Item(
        "webster",
        "greens of the fixed-time signal",
        partial(_without_runs, paper_tables.webster_table),
    )
    for arms in (3, 4, 5):
        yield Item(
            f"harmony-{arms}way", f"harmony matrix, {arms} arms",
            partial(_without_runs, partial(paper_tables.harmony_table, arms)),
        )  # fmt: skip


def _beyond() -> Iterable[Item]:
    yield Item("fair", "every controller up to 800 veh/h/lane", beyond.fair_figure, ("fair",))
    yield Item("losses", "demand from which on DIM loses", beyond.crossing_figure, ("fair",))
    yield Item(
        "losses-table",
        "losses in numbers",
        paper_tables.loss_table,
        ("fair",),
    )
    yield Item("gate", "clear against harmonious gate", beyond.gate_figure, ("gate",))
    yield Item(
        "fairness", "fixed, rotating and longest-waiting priority", beyond.fairness_figure,
        ("fairness",),
    )  # fmt: skip
    yield Item("humans", "delay over the share of human drivers", mixing.human_figure, ("humans",))
    yield Item(
        "perception", "collisions, false grants and delay over intent errors",
        misreading.perception_figure, ("perception",),
    )  # fmt: skip
    yield Item(
        "perception-monitored", "the same with a safety monitor in every vehicle",
        partial(misreading.perception_figure, series="dim:monitor=on"), ("perception",),
    )  # fmt: skip
    yield Item(
        "perception-table", "outcomes of 15 % misread intents", misreading.perception_table,
        ("perception",),
    )  # fmt: skip
    yield Item(
        "confidence", "collisions, false grants and delay over the confidence that is believed",
        misreading.confidence_figure, ("confidence",),
    )  # fmt: skip
    yield Item("capacity", "largest demand served", beyond.capacity_figure, ("capacity",))
    yield Item(
        "capacity-table",
        "capacity in numbers",
        paper_tables.capacity_table,
        ("capacity",),
    )


#: All figures and tables, in the order of the paper, then what it does not have.
GALLERY: Mapping[str, Item] = MappingProxyType(
    {item.name: item for item in (*_schematic(), *_results(), *_beyond())}
)


def item_named(name: str) -> Item:
    """A figure or table by name; raises `InputError` with the nearest one."""
    return GALLERY[choice("figure", name, GALLERY)]


def write(drawing: Drawing, folder: Path, name: str) -> list[Path]:
    """Write a drawing in all its formats, each whole or not at all; returns the files."""
    suffixes = FORMATS if isinstance(drawing, Figure) else tuple(WRITERS)
    files = [folder / f"{name}.{suffix}" for suffix in suffixes]
    for file in files:
        if isinstance(drawing, Figure):
            save(drawing, file)
        else:
            save_table(drawing, file)
    return files
