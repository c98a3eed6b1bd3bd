import shutil
from pathlib import Path

import pytest

from baselines import AllWayStop, Reservation
from dim import Dim, ExactPerception, NoisyPerception
from minisim.errors import FileError, InputError
from scenarios.benchmark.definition import (
    SCHEDULE,
    Benchmark,
    entrants,
    read_benchmark,
    standard_file,
)
from scenarios.controllers import safe

#: Version -> digest. A changed definition is another benchmark: raise its version.
DIGESTS = {1: "49b37e409dc9dffc", 2: "2967f6a664bd5f4e"}

HEAD = 'name = "ours"\nversion = 2\nseeds = [3, 5]\nhorizon = 60\n'


def read(folder: Path, text: str, quick: bool = False) -> Benchmark:
    file = folder / "ours.toml"
    file.write_text(text)
    return read_benchmark(file, quick=quick)


def test_the_definition_is_that_of_its_version() -> None:
    made = read_benchmark()
    assert (made.name, made.digest) == ("minisim", DIGESTS[made.version])


def test_what_its_files_say_belongs_to_the_definition(tmp_path: Path) -> None:
    for file in standard_file().parent.glob("benchmark*.toml"):
        shutil.copy(file, tmp_path)
    peak = tmp_path / "benchmark_peak.toml"
    assert read_benchmark(tmp_path / "benchmark.toml").digest == DIGESTS[2]
    peak.write_text(peak.read_text().replace("rates = [700, ", "rates = [701, "))
    assert read_benchmark(tmp_path / "benchmark.toml").digest != DIGESTS[2]


def test_cells_are_plain_unless_vehicles_err_humans_drive_or_messages_fail() -> None:
    made = read_benchmark()
    assert len(made.cells) == 14
    assert {cell.name for cell in made.cells} - {*made.plain} == {
        "misread signals", "40 % humans", "messages lost",
    }  # fmt: skip
    assert {cell.scenario.intersection.n for cell in made.cells} == {3, 4, 5}


def test_every_run_has_time_for_its_last_vehicle_and_a_quick_one_is_short() -> None:
    full, quick = read_benchmark(), read_benchmark(quick=True)
    assert (len(full.seeds), len(quick.seeds)) == (10, 2)
    for made, demand in ((full, 600.0), (quick, 100.0)):
        assert {cell.scenario.until for cell in made.cells} == {demand}
        assert all(cell.scenario.horizon >= 6.0 * demand for cell in made.cells)
    assert full.digest == quick.digest


def test_a_cell_says_how_its_controllers_perceive_and_which_vehicles_humans_drive() -> None:
    cells = {cell.name: cell for cell in read_benchmark().cells}
    plain, erring, humans = (cells[name] for name in ("4 arms", "misread signals", "40 % humans"))
    noisy = NoisyPerception(intent_error=0.1, kind="symmetric")
    own = NoisyPerception(intent_error=0.2)
    asked = [(plain, Dim()), (erring, Dim()), (plain, Dim(perception=own)), (humans, Dim())]
    made = [cell.recipe("x", controller, 1) for cell, controller in asked]
    perceptions = [getattr(it.controller, "perception", None) for it in made]
    assert perceptions == [ExactPerception(), noisy, own, ExactPerception()]
    assert [it.humans for it in made] == [0.0, 0.0, 0.0, 0.4]
    assert erring.recipe("x", AllWayStop(), 1).controller == AllWayStop()
    assert humans.recipe("x", AllWayStop(), 1).humans == 0.0
    with pytest.raises(InputError, match="needs messages from every vehicle, and humans send none"):
        humans.recipe("x", Reservation(), 1)


def test_messages_fail_where_a_controller_sends_them() -> None:
    cell = next(it for it in read_benchmark().cells if it.name == "messages lost")
    failing, silent = (cell.recipe("x", it, 1) for it in (Reservation(), AllWayStop()))
    assert (failing.latency, failing.loss, failing.name) == (0.1, 0.3, "x")
    assert silent.driven == AllWayStop()


def test_all_runs_of_a_seed_have_the_same_arrivals() -> None:
    made = read_benchmark(quick=True)
    runs = list(made.runs([("stop", AllWayStop()), ("reservation", Reservation())]))
    assert len(runs) == 14 * 2 * 3
    assert [name for _, name, _, _ in runs[:3]] == [SCHEDULE, "stop", "reservation"]
    refused = [(cell.name, name) for cell, name, _, it in runs if isinstance(it, InputError)]
    assert refused == [("40 % humans", "reservation")] * 2
    for cell, name, seed, it in runs:
        if not isinstance(it, InputError):
            assert (it.scenario, it.seed, it.name) == (cell.scenario, seed, name)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("version = 1\n", "the benchmark has no name"),
        ('name = "x"\nversion = 0\n', "version of the benchmark must be an integer"),
        ('name = "x"\nversion = 1\nquick = 3\n', r"\[quick\] must be a dict, got 3"),
        (HEAD + "[experiment]\ndensity = 3\n", "with two brackets"),
        (HEAD + 'demand = "nowhere.toml"\n', "nowhere.toml: No such file"),
        (HEAD + 'metrics = ["stops"]\n', "cells have no metrics; leave it out"),
        (HEAD + 'on_collision = "record"\n', "cells have no on_collision"),
        (HEAD + 'controller = "reservation"\n', "a cell is dim, .* got 'reservation'"),
        (HEAD + 'controller = "v2ic"\n', "v2ic if messages fail, got 'v2ic'"),
        (HEAD + 'controller = "v2ic:reach=90"\nloss = 0.1\n', "got 'v2ic:reach=90"),
        (HEAD + "loss = 0.1\n", "a controller that vehicles talk to, such as v2ic; dim sends none"),
        (HEAD + 'controller = "dim:gate=harmonious"\n', "got 'dim:gate=harmonious'"),
        (HEAD + "[quick]\nsedes = 3\n", r"unknown key of \[quick\] 'sedes'.*mean 'seeds'"),
        (HEAD + "sedes = 3\n", "unknown key 'sedes'.*did you mean 'seeds'"),
        (HEAD + 'controller = "dimm"\n', "did you mean 'dim'"),
        (HEAD + "density = [50, 100]\n", "two cells are called 'four-way'"),
        (HEAD + "horizon = 2\n", "not valid TOML"),
    ],
)
def test_a_wrong_definition_is_refused_by_its_file(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises((InputError, FileError), match=rf"ours\.toml.*{why}"):
        read(tmp_path, text)


def test_quick_replaces_keys_of_every_block(tmp_path: Path) -> None:
    text = HEAD + "[quick]\nseeds = 1\nhorizon = 20\n"
    quick = read(tmp_path, text, quick=True)
    assert (quick.seeds, quick.cells[0].scenario.horizon) == ((1,), 20.0)
    assert read(tmp_path, text).seeds == (3, 5)


def test_all_that_promise_no_collision_take_part_or_those_that_are_named(tmp_path: Path) -> None:
    mine = tmp_path / "benchmark_entrant.py"
    mine.write_text("from baselines import AllWayStop\n\nclass Mine(AllWayStop):\n    name = 'm'\n")
    everyone = [name for name, _ in entrants()]
    assert set(everyone) >= {*safe()}
    assert [name for name, _ in entrants(added=[f"{mine}:Mine"])] == [*everyone, "m"]
    assert [name for name, _ in entrants(["dim", "dim:gate=harmonious"])] == [
        "dim", "dim:gate=harmonious",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("only", "added", "why"),
    [
        (["dim", "dim:gate=clear"], [], "two controllers are called dim"),
        (None, ["dim"], "two controllers are called dim"),
        (["fixed"], [], "unknown controller 'fixed'"),
    ],
)
def test_each_takes_part_once(only: list[str] | None, added: list[str], why: str) -> None:
    with pytest.raises(InputError, match=why):
        entrants(only, added)
