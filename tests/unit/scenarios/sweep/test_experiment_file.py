"""Experiment files: what they can say, and the sentences about what is wrong in them."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest

from baselines import V2IC, FixedTime
from dim import Dim, Zones
from minisim.errors import FileError, InputError
from minisim.recorded import read_arrivals, write_arrivals
from scenarios import five_way, four_way, from_bearings, three_way
from scenarios.recipe import Recipe
from scenarios.sweep.file import read_experiments
from scenarios.sweep.rows import identity_of
from tests.unit.scenarios.cli.test_cli import Captured, fails


def read(tmp_path: Path, text: str) -> list[Recipe]:
    file = tmp_path / "e.toml"
    file.write_text(text)
    return read_experiments(file)


@pytest.mark.parametrize("text", ["", "# nothing yet", "[[experiment]]"])
def test_a_file_that_names_nothing(text: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the file does not say what to run; name a scenario"):
        read(tmp_path, text)


HARMONIOUS = Dim(gate="harmonious")

SAID = [
    ("horizon = 3600", [Recipe(four_way(350.0), Dim(), seed) for seed in range(1, 11)]),
    (
        'scenario = ["three-way", "five-way"]\ndensity = [150, 350]\nseeds = [7, 3]\n'
        'controller = ["dim", "fixed-time"]\nprofile = "fair"\nhorizon = 600\n',
        [
            Recipe(make(density, profile="fair", horizon=600), controller, seed)
            for make, density, controller, seed in product(
                (three_way, five_way), (150, 350), (Dim(), FixedTime()), (7, 3)
            )
        ],
    ),
    (
        'humans = [0, 0.25]\nseeds = [1]\ncontroller = "dim:gate=harmonious"\n',
        [Recipe(four_way(), HARMONIOUS, 1), Recipe(four_way(), HARMONIOUS, 1, 0.25)],
    ),
    (
        'loss = [0, 0.25]\nlatency = 0.1\nseeds = [1]\ncontroller = "v2ic"\n',
        [Recipe(four_way(), V2IC(), 1, latency=0.1, loss=loss) for loss in (0, 0.25)],
    ),
    ("seeds = [1]\ndemand_time = 60", [Recipe(four_way(demand_time=60.0), Dim(), 1)]),
    ('seeds = [1]\nsplit = "(4,3,2,1)"', [Recipe(four_way(split=(4, 3, 2, 1)), Dim(), 1)]),
    (
        "seeds = [1]\nsplit = [4, 3, 2, 1]\nturns = [1, 2, 1]",
        [Recipe(four_way(split="4:3:2:1", turns="1:2:1"), Dim(), 1)],
    ),
    (
        'seeds = [1]\nsplit = [[4, 3, 2, 1], "balanced", "4:1:4:1"]',
        [Recipe(four_way(split=split), Dim(), 1) for split in ("4:3:2:1", None, "4:1:4:1")],
    ),
    *(
        (
            f"seeds = [1]\nwarmup = 600\nmetrics = {metrics}",
            [Recipe(four_way(warmup=600.0), Dim(), 1, metrics=("pets", "trips"))],
        )
        for metrics in ('"pets, trips"', '["pets", "trips"]')
    ),
]


@pytest.mark.parametrize(("text", "expected"), SAID)
def test_what_a_file_can_say(text: str, expected: list[Recipe], tmp_path: Path) -> None:
    assert read(tmp_path, text) == expected


def test_everything_of_a_demand_can_be_said(tmp_path: Path) -> None:
    bearings = "bearings = [0, 80, 190, 260], arm_length = 300"
    (found,) = read(
        tmp_path,
        'split = "4:3:2:1"\nturns = "1:2:1"\nmodel = "shifted"\nmin_headway = 2\nside = "right"\n'
        f'density = 200\nseeds = [5]\nscenario = {{name = "custom", label = "odd", {bearings}}}\n'
        'controller = {name = "dim", label = "inflow", priorities = "inflow", zones = {red = 20}}\n'
        'on_collision = "record"\n',
    )
    scenario = from_bearings(
        [0, 80, 190, 260], 200, name="odd", side="right", arm_length=300, split=(4, 3, 2, 1),
        turns=(1, 2, 1), model="shifted", min_headway=2,
    )  # fmt: skip
    assert found.scenario == scenario
    assert found.controller == Dim(priorities="inflow", zones=Zones(red=20))
    assert (found.name, found.seed, found.on_collision) == ("inflow", 5, "record")
    assert identity_of(found)["split"] == "4:3:2:1"
    assert identity_of(found)["turns"] == "1:2:1"


def test_blocks_share_what_is_above_them(tmp_path: Path) -> None:
    found = read(
        tmp_path,
        'seeds = 1\ndensity = 150\n[[experiment]]\ncontroller = "fixed-time"\n'
        '[[experiment]]\nscenario = "three-way"\ndensity = 300\n[[experiment]]\nseeds = 2\n'
        '[[experiment]]\ncontroller = [{name = "fixed-time", greens = [9, 8, 7, 6], label="x"}]\n'
        "[[experiment]]\n",
    )
    assert found == [
        Recipe(four_way(150.0), FixedTime(), 1),
        Recipe(three_way(300.0), Dim(), 1),
        Recipe(four_way(150.0), Dim(), 1),  # and not a second time by the last block
        Recipe(four_way(150.0), Dim(), 2),
        Recipe(four_way(150.0), FixedTime(greens=(9.0, 8.0, 7.0, 6.0)), 1, label="x"),
    ]


def test_recorded_arrivals_are_found_beside_the_file(tmp_path: Path) -> None:
    arrivals = four_way(300, horizon=100).arrivals(1)
    write_arrivals(arrivals, tmp_path / "a.csv")
    (found,) = read(tmp_path, 'arrivals = "a.csv"\nseeds = [0]\nhorizon = 100\n')
    assert found.scenario.recorded is not None
    assert found.scenario.recorded.time.tolist() == arrivals.time.tolist()
    assert found.scenario.density == pytest.approx(len(arrivals) * 36 / 4)
    assert identity_of(found)["split"] == "recorded"
    (later,) = read(tmp_path, 'arrivals = "a.csv"\nstart = "00:01"\nseeds = [0]\nhorizon = 100\n')
    expected = arrivals.time[arrivals.time >= 60.0] - 60.0
    assert later.scenario.recorded.time.tolist() == expected.tolist()


def test_arrivals_of_a_smaller_junction_are_refused(tmp_path: Path) -> None:
    """As on the command line and in Python."""
    write_arrivals(three_way(300, horizon=300).arrivals(1), tmp_path / "a.csv")
    told = "looks like arrivals of a junction with 3 arms: none comes from lane d or"
    with pytest.raises(InputError, match=rf"e.toml: .*a.csv {told}"):
        read(tmp_path, 'arrivals = "a.csv"\n')
    with pytest.raises(InputError, match=told):
        read_arrivals(tmp_path / "a.csv", 4)
    assert len(read_arrivals(tmp_path / "a.csv")) == len(read_arrivals(tmp_path / "a.csv", 3)) > 30


def test_the_command_line_may_replace_seeds_and_horizon(tmp_path: Path) -> None:
    file = tmp_path / "e.toml"
    file.write_text("seeds = 5\nhorizon = 100\n")
    found = read_experiments(file, seeds=2, horizon=50.0)
    assert [experiment.seed for experiment in found] == [1, 2]
    assert found[0].scenario.horizon == 50.0
    for text in ('seeds = "x"', "horizon = -1"):
        file.write_text(text)
        with pytest.raises(InputError, match=text[:5]):
            read_experiments(file, seeds=2, horizon=50.0)


WRONG = [
    ("densty = 3", r"unknown key 'densty'.*did you mean 'density'"),
    ("[[experiment]]\nsed = 1\n[[experiment]]", r"\[\[experiment\]\] 1: .*did you mean 'seeds'"),
    ("[experiment]\nseeds = 1", r"two brackets"),
    ("experiment = [1]", r"two brackets"),
    ("lane_width = 3.5", r"'lane_width'; it belongs to the scenario: scenario = { name = "
     r"\"four-way\", lane_width = … }"),
    ("[[experiment]]\nbearings = [0, 90, 180]", r"'bearings'; it belongs to the scenario"),
    ('gate = "harmonious"', r"'gate'; it belongs to a controller: controller = { name = \"dim\", "),
    ('scenario = {name = "four-way", density = 150}', r"scenario 'density'; it belongs on a line"),
    ('scenario = "for-way"', r"did you mean 'four-way'"),
    ('scenario = {name = "custom", bearing = [0]}', r"key of a scenario 'bearing'.*'bearings'"),
    ('scenario = {bearings = [0]}', r"has no name"),
    ('scenario = "custom"', r"needs bearings, such as scenario = { name = \"custom\", bea"),
    ("split = [[4, 3], 2]", r"split has 2 shares for 4 lanes"),
    ("warmup = 3600", r"warmup \[s\] must be .*below 3600"),
    ('scenario = {name = "four-way", label = 3}', r"label must be a text"),
    ("scenario = 4", r"scenario: must be a name"),
    ('controller = "dmi"', r"controller: unknown controller 'dmi'.*'dim'"),
    ('controller = {name = "dim", ordr = "size"}', r"dim parameter 'ordr'.*'order'"),
    ('controller = {name = "dim", zones = {rd = 3}}', r"zones=zones parameter 'rd'.*'red'"),
    ('controller = {name = "dim", zones = 3}', r"zones must be zones or a Zones"),
    ('controller = {name = "unregulated", x = 3}', r"unregulated has no parameters, got x"),
    ('profile = "fare"', r"unknown profile 'fare'.*'fair'"),
    ("profile = 3", r"unknown profile 3"),
    ('split = "4-3"', r"split must be balanced or like"),
    ("density = []", r"density is an empty list"),
    ('density = "many"', r"density"),
    ("seeds = 0", r"toml: seeds must be an integer 1 … .*, got 0; or a list of seeds"),
    ("seeds = [-1]", r"seeds: a seed must be"),
    ("seeds = 1000000000", r"seeds"),
    ("density = [1, 2, 3]\nseeds = 1000000", r"3000000 runs are more than"),
    ("horizon = [1]", r"horizon"),
    ('humans = 0.1\ncontroller = "fixed-time"', r"humans .*not with 'fixed-time'"),
    ("loss = [0, 0.1]", r"toml: messages can fail only with .* such as v2ic; dim sends none"),
    ('loss = 2\ncontroller = "v2ic"', r"toml: loss must be at least 0 and at most 1, got 2"),
    ("los = 0.1", r"unknown key 'los'.*did you mean 'loss'"),
    ('metrics = ["min_pet"]', r"unknown metric 'min_pet'.*did you mean 'min_pet_s'"),
    ("metrics = 3", r"metrics must be a sequence"),
    ('on_collision = "ignore"', r"unknown on_collision 'ignore'"),
    ('arrivals = "a.csv"\nsplit = "1:1:1:1"', r"arrivals replaces split"),
    ('arrivals = "a.csv"', r"a\.csv"),
    ("arrivals = 3", r"arrivals must be a text"),
    ('start = "07:00"', r"start needs arrivals or demand"),
    ('demand = "a.toml"', r"cannot read demand from .*a\.toml"),
    ('demand = "a.toml"\nturns = "1:1:1"', r"demand replaces turns"),
    ('demand = "a.toml"\narrivals = "a.csv"', r"arrivals replaces demand"),
    ("demand = 3", r"demand must be a text"),
    ('controller = ["dim", {name = "dim", label = "dim", order = "lanes"}]',
     r"both be called dim.*label"),
    ("density = [1, 2", r"not valid TOML"),
    ("min_headway = 2", r"min_headway needs the model 'shifted'"),
    ("seeds = 1\n[[experiment]]\nseeds = 2", r"seeds above the blocks is never used"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), WRONG)
def test_wrong_places_are_named(text: str, message: str, tmp_path: Path, capsys: Captured) -> None:
    with pytest.raises((InputError, FileError), match=message) as caught:
        read(tmp_path, text)
    file = str(tmp_path / "e.toml")
    assert file in str(caught.value)
    assert file in fails(capsys, "sweep", file, "--out", str(tmp_path / "s.db"))
    assert not (tmp_path / "s.db").exists()


def test_what_is_not_a_file_of_experiments(tmp_path: Path) -> None:
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    for name in ("missing.toml", "binary.toml"):
        with pytest.raises(FileError):
            read_experiments(tmp_path / name)


def test_a_controller_that_cannot_serve_is_told_first(tmp_path: Path, capsys: Captured) -> None:
    file, store = tmp_path / "e.toml", tmp_path / "s.db"
    file.write_text('scenario = "three-way"\ncontroller = "fixed-time:greens=(1,2)"\n')
    said = fails(capsys, "sweep", str(file), "--out", str(store))
    assert "fixed-time:greens=(1,2) cannot serve three-way at 350 veh/h/lane" in said
    assert "2 values" in said
    assert not store.exists()
