"""docs/background/fidelity.md cannot rot: its quick commands print what it quotes, the others are valid."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from typing import Any

import pytest
import typer

from scenarios.cli import app, main
from scenarios.controllers import controller_named
from scenarios.library import scenario_named
from scenarios.profiles import profile_named
from tests import ROOT

PAGE = (ROOT / "docs" / "background" / "fidelity.md").read_text(encoding="utf-8")


def blocks(kind: str) -> list[str]:
    return [line for b in re.findall(rf"```{kind}\n(.*?)```", PAGE, re.DOTALL)
            for line in b.rstrip().split("\n$ " if kind == "console" else "\n")]  # fmt: skip


QUICK = [(line.removeprefix("$ ").partition("\n")[0], line.partition("\n")[2].splitlines())
         for line in blocks("console")]  # fmt: skip
LONG = sorted(set(blocks("sh")))


def printed(command: str, capsys: pytest.CaptureFixture[str]) -> str:
    program, *arguments = shlex.split(command)
    if program == "minisim":
        assert main(arguments) == 0
        return capsys.readouterr().out
    program = sys.executable if program == "python" else program
    return subprocess.run(
        [program, *arguments], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout


@pytest.mark.parametrize(("command", "quoted"), QUICK, ids=[command for command, _ in QUICK])
def test_quick_commands_print_what_is_quoted(
    capsys: pytest.CaptureFixture[str], command: str, quoted: list[str]
) -> None:
    lines = [" ".join(line.split()) for line in printed(command, capsys).splitlines()]
    assert quoted
    for line in quoted:
        assert " ".join(line.split()) in lines


@pytest.mark.parametrize("command", LONG)
def test_long_commands_are_valid(command: str) -> None:
    """Parsed as the command line does, and everything that they name exists."""
    program, name, *arguments = shlex.split(command)
    if program == "python":
        assert (ROOT / [name, *arguments][-1]).is_file()
        return
    assert program == "minisim"
    click: Any = typer.main.get_command(app)
    values = click.commands[name].make_context(name, arguments).params
    profile = profile_named(values.get("profile") or "fair")
    if isinstance(values.get("controller"), str):
        controller_named(values["controller"], profile)
    for scenario in values.get("scenarios") or [values.get("scenario")]:
        if scenario is not None:
            scenario_named(scenario)
    if values.get("arrivals") is not None:
        assert (ROOT / values["arrivals"]).is_file()


def test_every_discrepancy_has_its_place() -> None:
    headings = re.findall(r"^### ([0-9]+)(?:–([0-9]+))?\. ", PAGE, re.MULTILINE)
    numbered = [n for a, b in headings for n in range(int(a), int(b or a) + 1)]
    assert numbered == list(range(1, 18))
    assert len(QUICK) >= 8
    assert len(LONG) >= 12
