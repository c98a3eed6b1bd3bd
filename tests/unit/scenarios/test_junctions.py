"""Junctions as files: what is written is read again."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given

import minisim
from dim import Dim
from minisim.errors import FileError, InputError
from minisim.junction.geometry import Intersection
from minisim.junction.roads import Road
from scenarios import four_way
from scenarios.junctions import junction_from, junction_text
from scenarios.library import from_file, scenario_named
from scenarios.strategies import uneven
from scenarios.sweep.file import read_experiments
from tests.builders import town_text

PLACES = {"n": (0.0, 200.0), "e": (200.0, 0.0), "s": (0.0, -200.0)}


@given(uneven())
def test_a_junction_is_what_its_file_says(tmp_path_factory, scenario) -> None:
    path = tmp_path_factory.mktemp("j") / "junction.toml"
    path.write_text(junction_text('with "quotes" \\', scenario.intersection), encoding="utf-8")
    name, intersection = junction_from(path)
    assert name == 'with "quotes" \\'
    assert intersection == scenario.intersection


def test_towns_and_tables_are_scenarios_by_name(tmp_path: Path) -> None:
    town, table = tmp_path / "town.net.xml", tmp_path / "mine.toml"
    town.write_text(town_text(PLACES, one_way=["eC"]))
    made = scenario_named(str(town), node="C", density=200.0, profile="fair", horizon=120.0)
    assert made.name == "town C"
    assert made.rates == (200.0, 200.0, 200.0)
    table.write_text(junction_text("mine", made.intersection))
    again = from_file(table, 200.0, profile="fair", horizon=120.0)
    assert again.intersection == made.intersection
    assert minisim.simulate(again, Dim(), 1).trips.equals(minisim.simulate(made, Dim(), 1).trips)


def test_files_of_experiments_name_junctions_beside_them(tmp_path: Path) -> None:
    (tmp_path / "town.net.xml").write_text(town_text(PLACES))
    mine = Intersection((0, 90, 180), roads=(Road(), Road(traffic="in"), Road()), side="right")
    (tmp_path / "mine.toml").write_text(junction_text("mine", mine))
    file = tmp_path / "sweep.toml"
    file.write_text(
        'seeds = 1\nscenario = [{ name = "town.net.xml", node = "C" }, "mine.toml", "four-way",\n'
        '{ name = "custom", bearings = [0, 90, 180], forbidden = ["a1"], '
        'roads = { b = { traffic = "out" } } }]\n'
    )
    first, second, third, fourth = (it.scenario for it in read_experiments(file))
    assert (first.name, first.intersection.side) == ("town C", "right")
    assert second.intersection == mine
    assert third.intersection == four_way().intersection
    assert fourth.intersection.approaches == (0, 2)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("bearings = [0, 90", "is not valid TOML"),
        (
            "bearing = [0, 90, 180]",
            "unknown key of a junction 'bearing'; .* did you mean 'bearings'",
        ),
        ("side = 'left'", "bearings are missing"),
        (
            "traffic = 'in'",
            r"mine.toml: unknown key 'traffic'; it belongs to a road, \[\[roads\]\]",
        ),
        ("bearings = [0, 10, 180]", "mine.toml: arms a and b are 10° apart"),
        ("bearings = [0, 90, 180]\nroads = [{ trafic = 'in' }, {}, {}]", "trafic"),
        ("bearings = [0, 90, 180]\nforbidden = ['d1']", "no movement 'd1'"),
    ],
)
def test_broken_tables_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises((FileError, InputError), match=message):
        junction_from(path)


def test_a_file_has_the_whole_junction(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("bearings = [0, 90, 180]\n")
    with pytest.raises(InputError, match="lane_width needs bearings"):
        from_file(path, lane_width=3.0)
    with pytest.raises(InputError, match="side needs a town's network"):
        from_file(path, side="left")
    with pytest.raises(InputError, match="node needs a town's network"):
        scenario_named("four-way", node="7")
    with pytest.raises(InputError, match="bearings need the scenario 'custom'"):
        scenario_named(str(path), bearings=[0, 90, 180])
    with pytest.raises(FileError, match="cannot read junction from"):
        scenario_named(str(tmp_path / "none.toml"))
