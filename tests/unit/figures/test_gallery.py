"""Figures and tables of results, made from rows of simple formulas, and the report."""

from __future__ import annotations

import csv
import io
import re
import sys
from collections.abc import Callable, Iterator
from functools import cache
from itertools import chain, combinations
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from baselines import webster
from dim import HarmonyMatrix
from figures import plots, style
from figures import reproduction_report as report
from figures.gallery import GALLERY, SECTIONS, write
from figures.junction.schematic import harmony_table, webster_table
from figures.tables import WRITERS, Table, save_table
from minisim.errors import InputError
from scenarios import studies
from scenarios.controllers import BARE, FAMILIES, RIVALS
from scenarios.paper import SERIES, Cell
from scenarios.recipe import Recipe
from scenarios.studies import NAMES, study_named
from scenarios.studies.shared.archive import Archive, MissingRunsError, missing_note
from scenarios.studies.shared.effort import Effort, Search
from scenarios.studies.shared.reproduction import Made
from scenarios.studies.shared.study import Study
from scenarios.sweep.cells import saturated
from scenarios.sweep.keys import key_of
from tests import ROOT
from tests.builders import capacity_of, reference_value, synthetic_find, synthetic_row

SEARCH = Search(step=20.0, steps=64, seeds=2)
EFFORT = Effort(seeds=2, search=SEARCH)


@pytest.fixture(scope="module", autouse=True)
def _recipes_once() -> Iterator[None]:
    """Make the recipes of a study once, whatever is known of their runs."""
    kept: dict[object, Any] = {}
    runs = Study.runs

    def once(study: Study, *asked: Any) -> Any:
        key = study.name, *asked
        if key not in kept:
            kept[key] = runs(study, *asked)
        return kept[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Study, "runs", once)
        yield


@pytest.fixture(scope="module")
def archive() -> Archive:
    return Archive(synthetic_find, EFFORT)


def having(wanted: Callable[[Recipe], bool], effort: Effort = EFFORT, **columns: Any) -> Archive:
    """Synthetic runs of the wanted recipes, with other values in some columns."""
    return Archive(
        lambda asked: [{**synthetic_row(e), **columns} if wanted(e) else None for e in asked],
        effort,
    )


#: A store without adaptive signals, and one without any run.
PARTIAL, EMPTY = having(lambda e: e.label != "adaptive"), having(lambda _: False)


@cache
def drawn(name: str, archive: Archive) -> Any:
    return GALLERY[name].build(archive)


def texts_of(figure: Figure) -> list[str]:
    return [" ".join(text.get_text().split()) for text in figure.texts]


@pytest.mark.parametrize("name", GALLERY)
def test_everything_can_be_made_and_nothing_is_cut_off(name: str, archive: Archive) -> None:
    drawing = drawn(name, archive)
    if isinstance(drawing, Table):
        assert drawing.rows
        return
    drawing.draw_without_rendering()
    for text in drawing.findobj(match=lambda a: hasattr(a, "get_text")):
        box = text.get_window_extent()
        if text.get_text() and text.get_visible() and box.width:
            assert -1 <= box.x0 <= box.x1 <= drawing.bbox.x1 + 1, text
            assert box.y1 <= drawing.bbox.y1 + 1, text
    texts = (text for text in drawing.texts if text.get_text())
    above = [item.get_window_extent() for item in (*texts, *drawing.legends)]
    assert not any(one.overlaps(other) for one, other in combinations(above, 2))


def test_every_study_is_drawn_and_every_need_is_a_study() -> None:
    assert {need for item in GALLERY.values() for need in item.needs} == set(NAMES)


def test_the_study_of_the_guide_is_complete(monkeypatch: pytest.MonkeyPatch) -> None:
    guide = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    for room in ("scenarios", "figures"):
        name = f"{room}.studies.signals"
        head = f'"""{name.replace(".", "/")}.py"""'
        (block,) = re.findall(rf"```python\n({head}\n.*?)```", guide, re.DOTALL)
        module = ModuleType(name)
        monkeypatch.setitem(sys.modules, name, module)
        exec(block, module.__dict__)
    monkeypatch.setattr(studies, "NAMES", (*NAMES, "signals"))
    (item,) = module.SECTION.items
    figure = item.build(Archive(synthetic_find, EFFORT))
    assert [len(axes.get_legend_handles_labels()[0]) for axes in figure.axes] == [2, 2, 2]


@pytest.mark.parametrize("name", ["worst-case", "losses-table", "gate"])
def test_same_results_same_bytes(name: str, archive: Archive, tmp_path: Path) -> None:
    written = [
        [file.read_bytes() for file in write(GALLERY[name].build(archive), tmp_path, name)]
        for _ in range(2)
    ]
    assert len(written[0]) == 3
    assert written[0] == written[1]


def test_nothing_to_draw_says_how_to_make_it() -> None:
    for item in GALLERY.values():
        if item.needs:
            with pytest.raises(MissingRunsError, match=r"minisim reproduce --only .* --seeds 2"):
                item.build(EMPTY)


@pytest.mark.parametrize("study", ["text", "as-run"])
@pytest.mark.parametrize("name", ["waiting-balanced", "travel-arms", "lanes"])
def test_one_of_two_studies_is_drawn(name: str, study: str) -> None:
    runs = {key_of(recipe) for _, recipe in study_named(study).runs(EFFORT.seeds)}
    drawing = GALLERY[name].build(having(lambda e: key_of(e) in runs))
    if isinstance(drawing, Table):
        columns = {"as-run": 3, "text": 5}
        for other, column in columns.items():
            assert {row[column] == "–" for row in drawing.rows} == {other != study}
        return
    assert [len(axes.get_legend_handles_labels()[0]) > 0 for axes in drawing.axes] == [
        study == "as-run", study == "text",
    ]  # fmt: skip
    assert any("no run" in text for text in texts_of(drawing))


def test_what_is_missing_is_said_in_the_picture() -> None:
    figure = drawn("fair", PARTIAL)
    (note,) = [text for text in texts_of(figure) if "no run" in text]
    assert "adaptive (fair, 4 arms, balanced, 50)" in note
    assert "9 more" in note


def test_small_print_counts_the_runs_that_there_are() -> None:
    """Seed 2 of the all-way stop is missing, and V2I-C of the published runs has three seeds."""
    some = having(lambda e: (e.label, e.seed) != ("all-way-stop", 2))
    (note,) = [t for t in texts_of(drawn("fair", some)) if "s each" in t]
    assert note.startswith("348 of 360 runs (2 seeds per case), 3600 s each. Fewer runs: all-way")
    assert "all-way-stop (fair, 4 arms, balanced, 150) has 1; and 9 more." in note
    assert "no run" not in note
    archive = Archive(synthetic_find, Effort(seeds=5))
    assert missing_note(archive.study("as-run")).startswith("3 to 5 seeds, 3600")


def test_losses_end_where_the_runs_do() -> None:
    archive = Archive(synthetic_find, Effort(seeds=2, densities=(150.0, 350.0)))
    assert "demands tried, 150 to 350." in drawn("losses-table", archive).notes[0]
    for axes in drawn("losses", archive).axes:
        assert axes.get_xticks().tolist() == [150.0, 350.0]
        bars = [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in axes.patches]
        assert bars
        assert all(150.0 <= low <= high <= 350.0 for low, high in bars)
    with pytest.raises(MissingRunsError, match="DIM and another controller"):
        GALLERY["losses"].build(having(lambda e: e.label == "dim"))


def test_the_paper_s_values_are_drawn_where_they_are(archive: Archive) -> None:
    figure = drawn("waiting-4321", archive)
    for axes in figure.axes:
        hollow = [line for line in axes.lines if line.get_markerfacecolor() == "none"]
        for line, (published, series) in zip(hollow, SERIES.items(), strict=True):
            assert line.get_marker() == style.look(series).marker
            wanted = {
                reference_value(Cell("4:3:2:1", d, 4, published), "waiting_time_s")
                for d in (150, 200, 250, 300, 350)
            }
            assert set(np.asarray(line.get_ydata(), float).tolist()) == wanted
        crossed = [line for line in axes.lines if line.get_marker() == "x"]
        assert [len(np.asarray(line.get_xdata())) for line in crossed] == [0, 5, 5, 5]


def test_our_means_are_drawn_where_they_are(archive: Archive) -> None:
    figure = drawn("fair", archive)
    (results,) = archive.need("fair")
    handles = figure.axes[0].get_legend_handles_labels()[0]
    for handle, series in zip(handles, FAMILIES[BARE], strict=True):
        rows = results.good[results.good["series"] == series]
        means = rows.groupby("density")["complete_waiting_time_s"].mean()
        np.testing.assert_allclose(np.asarray(handle.lines[0].get_ydata(), float), means)
    shown = results.good[results.good["series"].isin(FAMILIES[BARE])]
    grown = sum(saturated(cell) for _, cell in shown.groupby(["series", "density"]))
    arrows = [t for t in figure.axes[0].texts if getattr(t, "arrow_patch", None) is not None]
    assert len(arrows) == grown > 0, "where queues grow"


def test_every_rival_is_named_once_and_pale_in_the_rows_of_other_families(archive: Archive) -> None:
    figure = drawn("fair", archive)
    named = [[text.get_text() for text in legend.get_texts()] for legend in figure.legends]
    for axes, names, legend in zip(figure.axes[::3], FAMILIES.values(), named[:-1], strict=True):
        shown = [style.look(name).label for name in dict.fromkeys(("dim", *names))]
        assert axes.get_legend_handles_labels()[1] == shown
        assert legend == [*shown, "the others"]
        pale = [line for line in axes.lines if line.get_color() == plots.OTHERS.colour]
        assert len(pale) == len(RIVALS) - len(shown)
    assert sorted(chain(*FAMILIES.values())) == sorted(RIVALS)


def test_log_axis_shows_plain_numbers() -> None:
    figure = style.new_figure(4, 3)
    axes = figure.add_subplot()
    plots.log_time(axes, 0.0, 500.0, linear=0.1)
    figure.draw_without_rendering()
    assert [t.get_text() for t in axes.get_yticklabels()] == ["0", "0.1", "1", "10", "100"]


def test_webster_table_by_hand() -> None:
    """C0 = (1.5·8 + 5)/(1 − 4q/1500), g = (C0 − 8)/4; at 150: 28.33 and 5.08 s."""
    table = webster_table()
    assert [row[0] for row in table.rows] == ["150", "200", "250", "300", "350"]
    assert [row[2] for row in table.rows] == ["5.08", "7.11", "10.75", "19.25", "61.75"]
    assert [row[1] for row in table.rows] == ["5", "7", "10.75", "19.75", "61.75"]
    assert table.rows[0][4] == "28.33"
    assert table.rows[4][6] == f"{350 * 255 / (1500 * 61.75):.3f}"
    assert webster((150,) * 4).greens[0] == pytest.approx(5.0833, abs=1e-4)


@pytest.mark.parametrize("arms", [3, 4, 5])
def test_harmony_table_is_the_published_matrix(arms: int) -> None:
    table = harmony_table(arms)
    paper = HarmonyMatrix.paper(arms)
    entries = [[cell.rstrip("≠") == "1" for cell in row[1:]] for row in table.rows]
    np.testing.assert_array_equal(entries, paper.values)
    assert "same matrix" in table.notes[0]


def test_lane_table_has_the_paper_s_numbers(archive: Archive) -> None:
    printed = {row[:2]: row[2] for row in drawn("lanes", archive).rows}
    assert printed["4-way", "d"] == "10.21"
    assert printed["5-way", "e"] == "146.11"
    assert printed["3-way", "a"] == "0.46 †", "its run stopped early"


def test_capacity_table_has_what_the_rows_hold(archive: Archive) -> None:
    table = drawn("capacity-table", archive)
    first = dict(zip(table.headings, table.rows[0], strict=True))
    assert first["controller"] == "DIM"
    for arms in (3, 4, 5, 6):
        value = float(first[f"{arms} arms"].split(" ± ")[0])
        assert value == pytest.approx(capacity_of("dim", arms) / 0.98, abs=20.0)


def test_table_formats(tmp_path: Path) -> None:
    table = Table("50 % & more", ("a_b", "c"), (("x", "1 ± 2"),), notes=("≥ 3",))
    text = "**50 % & more**\n\n| a_b | c |\n| --- | ---: |\n| x | 1 ± 2 |\n\n≥ 3\n"
    assert table.markdown() == text
    assert list(csv.reader(io.StringIO(table.csv()))) == [["a_b", "c"], ["x", "1 ± 2"]]
    latex = table.latex()
    assert r"\caption{50 \% \& more}" in latex
    assert r"a\_b & c \\" in latex
    assert r"x & 1 $\pm$ 2 \\" in latex
    for suffix in WRITERS:
        save_table(table, tmp_path / f"t.{suffix}")
    with pytest.raises(InputError, match=r"\.xlsx"):
        save_table(table, tmp_path / "t.xlsx")
    with pytest.raises(InputError, match="2 cells"):
        Table("t", ("a", "b"), (("1",),))


FEW = ("webster", "gate", "losses-table", "comparison-text")


def test_report_names_everything(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a few figures only: all of them are made above."""
    monkeypatch.setattr(report, "GALLERY", {name: GALLERY[name] for name in FEW})
    pictures = tmp_path / "figures"
    failed = {"controller": "x", "scenario": "four-way", "density": 1.0, "seed": 3, "error": "no"}
    made = [Made("text", 700, 700.0, 699, 12.3, 45.6, (failed,))]
    done: list[int] = []
    count = report.write_report(PARTIAL, made, 2, tmp_path, lambda k, total: done.append(k))
    assert count == len(FEW) == len(done)
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "![the gates of DIM](figures/gate.png)" in text
    assert (pictures / "gate.png").is_file()
    assert (pictures / "webster.tex").is_file()
    assert "| text |" in text
    assert "four-way, 1 veh/h/lane, seed 3: no" in text
    assert "CPU seconds for one simulated hour" in text
    assert "fixed-time signal, 4 arms, balanced: 500, 600, 700, 800 veh/h/lane" in text
    assert "**13** " in text
    assert "**9a** " in text
    assert "None in any run." in text, "no collision"
    assert report.write_report(EMPTY, made, 1, tmp_path, lambda done, total: None) == 1
    assert "the store has no run of gate" in (tmp_path / "report.md").read_text(encoding="utf-8")


def test_a_report_has_nothing_of_others(
    archive: Archive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report, "GALLERY", {name: GALLERY[name] for name in FEW})
    made = [Made("gate", 60, 60.0, 60, 1.0, 1.0, ())]
    assert report.write_report(archive, made, 2, tmp_path, lambda *_: None, parts=("gate",)) == 1
    assert {file.stem for file in (tmp_path / "figures").iterdir()} == {"gate"}
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    headings = [line.removeprefix("## ") for line in text.splitlines() if line.startswith("## ")]
    assert headings == [
        "What was run", "How far do other gates move it?",
        "Collisions", "Over-saturated cells", "Failed runs",
    ]  # fmt: skip
    assert "| controller | gate |" in text
    assert "- fair: " not in text


def test_collisions_of_published_rules_have_their_cause(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "comparison-as-run"
    monkeypatch.setattr(report, "GALLERY", {name: GALLERY[name]})
    crashed = having(lambda e: e.label == "dim", Effort.of(quick=True), collisions=2)
    report.write_report(crashed, [], 1, tmp_path, lambda done, total: None, parts=("as-run",))
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "- as-run: DIM, 5 arms, balanced, 350 veh/h/lane: 4 in 0.1 h" in text
    assert "Why DIM collides as it was run: the published five-arm table" in text
    assert "- `as-run`: A smoke test: its numbers mean nothing. " in text


def test_no_two_drawings_have_the_same_name() -> None:
    names = [item.name for section in SECTIONS for item in section.items]
    assert len(names) == len(set(names))


def test_causes_that_share_a_number_are_named_once(archive: Archive) -> None:
    for row in drawn("comparison-as-run", archive).rows:
        assert len(row[-1].split()) == len(set(row[-1].split()))
