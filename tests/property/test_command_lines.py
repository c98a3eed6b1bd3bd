"""Random command lines: whatever is typed, there is an answer and never a traceback."""

from __future__ import annotations

import contextlib
import io
import itertools
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.cli import main
from tests.builders import share

FLAGS = """
--controller -c --humans --density -d --split --turns --profile --side --bearings --seed --horizon
--latency --jitter --loss
--warmup --on-collision --no-safety --metrics --by --json --arrivals --trips --trajectories --fcd
--host --order --clearance --csv --plot --out -o --seeds --jobs --export --start --seconds --fps
--only --store --list --quick --help --version --gate --commit --priorities --counterexample
"""

#: Ordinary values, and what people and machines get wrong.
VALUES = """
three-way 4-way 13-way custom dim dim:gate=harmonious dim:gate= dim:x=(1 fixed-time reservation
unregulated mine:Broken mine:Silent mine.py:Far no:Thing /dev/full:X 0 1 -1 1.5 1e309 nan 0x10
4:3:2:1 (4,3,2,1) [1,1,1] 1:0:0 0:0:0 ::, 0,120,240 0,1,2 left middle paper fair as_run lane kind
stop record teleport min_ttc_s waiting_time_s,x good.toml bad.toml endless.toml good.csv
semicolons.csv binary . .. / /dev/full /dev/null /dev/zero nowhere/x.csv a.csv a.xml a.png a.gif
s.db a1 b2 z9 clear paper(3) capacity
"""
ODD = ("", " ", "\N{BLACK CIRCLE}", "x" * 300, "x" * 300 + ".toml", "x" * 5000, "'", "\n")

#: Command -> what it is about, and what keeps it short; words drawn may come between them.
COMMANDS = {
    "run": ("three-way", ("--horizon", "20")),
    "benchmark": ("bad.toml", ()),
    "sweep": ("good.toml", ("--horizon", "5", "--jobs", "1")),
    "harmony": ("four-way", ()),
    "decide": ("four-way", ("a1", "b2")),
    "controllers": ("dim", ()),
    "figures": ("maps", ("--list",)),
    "metrics": ("--json", ()),
    "animate": ("three-way", ("--start", "0", "--seconds", "0.5")),
}

FILES = {
    "good.toml": 'scenario = "three-way"\nseeds = 1\nhorizon = 5\n',
    "bad.toml": "density = [1, 2",
    "endless.toml": "[" * 5000,
    "good.csv": "demand_time_s,lane,manoeuvre\n0,a,1\n",
    "semicolons.csv": "demand_time_s;lane;manoeuvre\n0;a;1\n",
    "mine.py": """
from minisim.control import Plan

class _Session:
    def __init__(self, answer, plan=Plan()):
        self.plan, self.decide = plan, answer

class Broken:
    name = "broken"
    def start(self, site):
        return _Session(lambda view: 1 / 0)

class Silent:
    name = "silent"
    def start(self, site):
        return _Session(lambda view: None)

class Far:
    name = "far"
    def start(self, site):
        return _Session(lambda view: (), Plan(sight=1e6))
""",
}


@pytest.fixture(scope="module", autouse=True)
def folder() -> Iterator[None]:
    """A working directory of its own, with good and bad files."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as place:
        os.chdir(place)
        for name, text in FILES.items():
            Path(name).write_text(text)
        Path("binary").write_bytes(bytes(range(256)))
        yield
        os.chdir(before)


@st.composite
def typed(draw: st.DrawFn) -> list[str]:
    """A command with its usual subject or a random one, options, and stray words."""
    command = draw(st.sampled_from(sorted(COMMANDS)))
    usual, short = COMMANDS[command]
    flags, values = st.sampled_from(FLAGS.split()), st.sampled_from([*VALUES.split(), *ODD])
    subject = draw(st.just(usual) | values)
    pairs = draw(st.lists(st.tuples(flags, values), max_size=3))
    stray = draw(st.lists(flags | values, max_size=1))
    return [command, subject, *itertools.chain(*pairs), *stray, *short]


@given(typed())
@share(0.5)
def test_every_command_line_has_an_answer(arguments: list[str]) -> None:
    out, told = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(told):
        code = main(arguments)
    assert code in (0, 1, 2)
    if code == 2:
        assert told.getvalue().startswith("minisim: ")
        assert told.getvalue().count("\n") == 1
        assert not out.getvalue()
