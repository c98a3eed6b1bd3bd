"""`minisim junction`, and junction files on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scenarios.cli import main
from tests.builders import town_text

PLACES = {"n": (0.0, 200.0), "e": (200.0, 0.0), "s": (0.0, -200.0)}


@pytest.fixture
def town(tmp_path: Path) -> str:
    path = tmp_path / "town.net.xml"
    path.write_text(town_text(PLACES, missing=[("nC", "Ce")]))
    return str(path)


def test_a_junction_is_told_saved_and_run(
    town: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    saved = str(tmp_path / "junction.toml")
    assert main(["junction", town, "--node", "C", "--save", saved]) == 0
    told = capsys.readouterr().out
    assert "node C (priority): right-hand traffic, junction radius 7.2 m" in told
    assert "a2" in told
    assert "a1" not in told
    runs = []
    for words in ([saved], [town, "--node", "C"]):
        assert main(["run", *words, "--horizon", "60", "--json", "--no-safety"]) == 0
        runs.append(json.loads(capsys.readouterr().out))
    assert runs[0]["trips"] == runs[1]["trips"] > 0


def test_all_nodes_are_listed_with_their_verdicts(
    town: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["junction", town, "--list"]) == 0
    told = capsys.readouterr().out
    assert "no   n, priority, 1 arm: 1 arm for cars; 3 are needed" in told
    assert max(map(len, told.splitlines())) <= 80
    assert "1 of 4 nodes can be read; 1 has 3 or more arms with one lane per direction" in told
    assert main(["junction", town, "--list", "--json"]) == 0
    rows = {row["node"]: row for row in json.loads(capsys.readouterr().out)}
    assert [name for name, row in rows.items() if row["readable"]] == ["C"]
    assert main(["junction", town, "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["roads"]) == 3


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--node", "D"], "no node 'D' among the 4"),
        (["--node", "n"], "cannot be read: 1 arm for cars"),
        (["--side", "left"], "side is for an extract"),
        (["--side", "up"], "unknown side 'up'"),
        (["--list", "--node", "C"], "leave out --node and --save"),
        (["--save", "junction.txt"], "junction.txt"),
    ],
)
def test_bad_input_is_one_sentence_and_code_2(
    town: str, words: list[str], message: str, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    assert main(["junction", town, *words]) == 2
    told = capsys.readouterr()
    assert message in told.err
    assert told.err.count("\n") == 1
    assert not told.out


def test_commands_about_rules_take_a_node_and_know_what_is_closed_there(
    town: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of the 26 cases of three arms, those without a1 remain: 2 · 3 · 3 − 1."""
    at = [town, "--node", "C"]
    assert main(["harmony", *at, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["closed"] == ["a1"]
    assert main(["harmony", *at]) == 0
    told = capsys.readouterr().out
    assert "● harmony, · conflict, – closed: no vehicle may take a1" in told
    rows = {line.split()[0]: line.split()[1:] for line in told.splitlines() if line.strip()}
    assert rows["a1"] == ["–"] * 6
    assert rows["b1"][0] == "–"
    assert "–" not in rows["b1"][1:]
    assert main(["verify", *at, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["cases"] == sum(told["cases_by_vehicles_that_go"].values()) == 17
    assert main(["decide", *at, "a2", "b1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["participants"] == ["a2", "b1"]
    assert main(["decide", *at, "a1", "b1"]) == 2
    assert "no vehicle may take a1 at town C" in capsys.readouterr().err
    states = []
    for where in (at, ["three-way"]):
        assert main(["protocol", *where, "--json"]) == 0
        states.append(json.loads(capsys.readouterr().out)["states"])
    assert states[0] < states[1]
    for command in (["harmony"], ["verify"], ["protocol"], ["decide", "a1"]):
        assert main([command[0], "four-way", *command[1:], "--node", "C"]) == 2
        assert "node needs a town's network" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        (
            ["four-way", "--gate", "passed"],
            "for 3 arms with the gate passed; four-way has 4, and too many states: take three-way",
        ),
        (["five-way"], "for 3 and 4 arms; five-way has 5, and too many states: take four-way"),
        (["five-way", "--gate", "past"], "'past'"),
    ],
)
def test_a_protocol_with_too_many_states_is_refused_at_once(
    asked: list[str], why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["protocol", *asked]) == 2
    assert why in capsys.readouterr().err


def test_a_hostile_file_is_one_sentence_and_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bomb.net.xml"
    path.write_text('<!DOCTYPE n [<!ENTITY a "ha">]><net>&a;</net>')
    for words in (["junction", str(path), "--list"], ["run", str(path)]):
        assert main(words) == 2
        assert "declares a document type" in capsys.readouterr().err
