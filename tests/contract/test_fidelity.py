"""docs/background/fidelity.md cannot rot: its quick commands print what it quotes.

That the others are valid, `test_docs.py` checks.
"""

from __future__ import annotations

import re
import shlex
import subprocess

import pytest

from scenarios.cli import main
from tests import ROOT

PAGE = (ROOT / "docs" / "background" / "fidelity.md").read_text(encoding="utf-8")


QUICK = [(line.removeprefix("$ ").partition("\n")[0], line.partition("\n")[2].splitlines())
         for block in re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL)
         for line in block.rstrip().split("\n$ ")]  # fmt: skip


def printed(command: str, capsys: pytest.CaptureFixture[str]) -> str:
    program, *arguments = shlex.split(command)
    if program == "minisim":
        assert main(arguments) == 0
        return capsys.readouterr().out
    if program == "python":  # in this process, which has imported it all
        assert arguments[0] == "-c"
        exec(arguments[1], {})
        return capsys.readouterr().out
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


def test_every_discrepancy_has_its_place() -> None:
    headings = re.findall(r"^### ([0-9]+)(?:–([0-9]+))?\. ", PAGE, re.MULTILINE)
    numbered = [n for a, b in headings for n in range(int(a), int(b or a) + 1)]
    assert numbered == list(range(1, 18))
    assert len(QUICK) >= 8
