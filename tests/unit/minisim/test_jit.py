"""Compiled code on disk: it must not outlive any source that it was compiled from."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from subprocess import PIPE

import pytest

import minisim.jit
from minisim import apart
from minisim.kept import digest_of
from tests.builders import python

pytestmark = pytest.mark.skipif(not minisim.jit.COMPILED, reason="numba is missing or off")

#: A caller in a file of its own: its bytes never change, only what it calls and reads does.
CALLER = """
from minisim.jit import njit
from outside.rule import FACTOR, rule

@njit
def answer(x: float) -> float:
    return rule(x) + FACTOR
"""

RULE = """
from minisim.jit import {decorator}

FACTOR = {factor}

@{decorator}
def rule(x: float) -> float:
    return {body}
"""

ASK = """
from outside.caller import answer
print(answer(10.0), "kept" if answer.stats.cache_hits else "compiled")
"""


#: Answers each folder and code, one per line, in a fork: numba takes longer to load and to warm up
#: than all else that the tests do.
FORKING = """
import json, os, sys, numba

numba.njit(lambda x: x + 1.0)(1.0)
sys.dont_write_bytecode = True  # sources change within a second, which bytecode would not notice
for line in sys.stdin:
    folder, code = json.loads(line)
    if not (child := os.fork()):
        try:
            os.chdir(folder)
            sys.path.insert(0, folder)
            os.environ["NUMBA_CACHE_DIR"] = os.path.join(folder, "kept")
            numba.config.reload_config()
            exec(code, {"__name__": "__main__"})
        finally:
            sys.stdout.flush()
            os._exit(0)
    os.waitpid(child, 0)
    print("end", flush=True)
"""

#: What a fresh process computes with the sources of a tree, and where it has the code from.
Ask = Callable[..., str]


@pytest.fixture(scope="module")
def ask() -> Iterator[Ask]:
    with subprocess.Popen(
        [sys.executable, "-c", FORKING], stdin=PIPE, stdout=PIPE, text=True, bufsize=1
    ) as server:
        assert server.stdin is not None is not server.stdout

        def answered(folder: Path, code: str = ASK) -> str:
            print(json.dumps([str(folder), code]), file=server.stdin)
            return "".join(iter(server.stdout.readline, "end\n")).strip()

        yield answered
        server.stdin.close()


def copied(folder: Path) -> Path:
    """A tree with the modules of the compiler alone, and a package of two modules that uses it."""
    source = Path(minisim.jit.__file__).parent
    (folder / "minisim").mkdir()
    (folder / "outside").mkdir()
    for package in ("minisim", "outside"):
        (folder / package / "__init__.py").write_text("")
    for name in ("apart.py", "compiling.py", "jit.py", "kept.py"):
        shutil.copy(source / name, folder / "minisim" / name)
    (folder / "outside" / "caller.py").write_text(CALLER)
    return folder


def write(folder: Path, *, decorator: str = "njit", factor: float = 0.5, body: str = "x") -> None:
    text = RULE.format(decorator=decorator, factor=factor, body=body)
    (folder / "outside" / "rule.py").write_text(text)


@pytest.mark.parametrize("decorator", ["njit_inner", "njit_inline"])
def test_a_change_of_what_is_called_is_seen(tmp_path: Path, decorator: str, ask: Ask) -> None:
    tree = copied(tmp_path)
    write(tree, decorator=decorator)
    assert ask(tree) == "10.5 compiled"
    assert ask(tree) == "10.5 kept"
    write(tree, decorator=decorator, body="x * 2.0")
    assert ask(tree) == "20.5 compiled"
    write(tree, decorator=decorator, body="x * 2.0", factor=0.25)
    assert ask(tree) == "20.25 compiled"
    # Controllers call functions of `minisim` from other folders.
    (tree / "minisim" / "other.py").write_text("SPEED = 1.0\n")
    assert ask(tree) == "20.25 compiled"


def test_python_may_call_what_is_compiled_for_compiled_callers_only(
    tmp_path: Path, ask: Ask
) -> None:
    tree = copied(tmp_path)
    write(tree, decorator="njit_inner")
    twice = (
        ASK + "from outside.rule import rule\nprint(rule(3.0), rule(x=4.0), len(rule.signatures))"
    )
    assert ask(tree, twice).split("\n") == ["10.5 compiled", "3.0 4.0 1"]


COLLECTING = """
import gc
from outside.caller import answer
begun = []
gc.callbacks.append(lambda phase, _: begun.append(phase == "start"))
print(answer(10.0), sum(begun) < 3, gc.isenabled())
"""


def test_no_garbage_is_collected_while_numba_compiles(tmp_path: Path, ask: Ask) -> None:
    tree = copied(tmp_path)
    write(tree)
    assert ask(tree, COLLECTING) == "10.5 True True"


COUNTED = """
import minisim
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys
from scenarios import four_way
from scenarios.controllers import controller_named

rtsys.initialize(cpu_target.target_context)
for profile in ("fair", "as_run"):
    before = rtsys.get_allocation_stats()
    scenario = four_way(350, profile=profile, horizon=30.0)
    minisim.simulate(scenario, controller_named("dim", profile), on_collision="record")
    after = rtsys.get_allocation_stats()
    print(after.alloc - before.alloc - (after.free - before.free))
"""


def test_compiled_code_keeps_no_memory() -> None:
    """It does not count references, so an array that it made would stay until the process ends."""
    assert python("-c", COUNTED, NUMBA_NRT_STATS="1").stdout.split() == ["0", "0"]


def test_looking_at_the_sources_is_quick() -> None:
    folder = Path(minisim.jit.__file__).parent
    times = []
    for _ in range(5):
        digest_of.cache_clear()
        begin = time.perf_counter()
        digest_of(folder)
        times.append(time.perf_counter() - begin)
    assert min(times) < 0.02  # measured: 2 ms; importing numba takes 300


def test_a_class_may_change_its_name(tmp_path: Path, ask: Ask) -> None:
    """What is on disk holds the classes of arguments; it must not be read when they have gone."""
    tree = copied(tmp_path)
    ask_with = (
        "from outside.caller import answer, {name}\n"
        "print(answer({name}(10.0)), 'kept' if answer.stats.cache_hits else 'compiled')"
    )
    for name in ("Old", "New"):
        (tree / "outside" / "caller.py").write_text(
            "from typing import NamedTuple\n"
            "from minisim.jit import njit\n"
            f"class {name}(NamedTuple):\n    x: float\n"
            "@njit\n"
            "def answer(of):\n    return of.x\n"
        )
        assert ask(tree, ask_with.format(name=name)) == "10.0 compiled"
        assert ask(tree, ask_with.format(name=name)) == "10.0 kept"


def test_who_waits_at_a_terminal_is_told_why(tmp_path: Path) -> None:
    folder = copied(tmp_path)
    (folder / "outside" / "rule.py").write_text(
        RULE.format(decorator="njit", factor=1.0, body="2.0 * x")
    )
    pty = pytest.importorskip("pty")
    said = []
    for _ in range(2):
        reader, terminal = pty.openpty()
        kept = {"PYTHONPATH": str(folder), "NUMBA_CACHE_DIR": str(folder / "kept")}
        subprocess.run(
            [sys.executable, "-c", ASK], cwd=folder, env={**os.environ, **kept}, stderr=terminal,
            stdout=subprocess.DEVNULL, check=True,
        )  # fmt: skip
        os.write(terminal, b"end")
        said.append(os.read(reader, 1000).decode())
        os.close(terminal)
        os.close(reader)
    assert said[0].count("minisim: compiling, once after installation") == 1
    assert said[1] == "end"


#: Compiles for integers, and is killed after its first file.
KILLED = """
import os
from outside.caller import answer

# Another process writes after this one has looked.
type(answer._cache._cache_file)._load_index = lambda self: {}
replace = os.replace

def replacing(*names):
    replace(*names)
    os._exit(0)

os.replace = replacing
answer(10)
"""


def test_half_written_code_is_not_taken_for_other_code(tmp_path: Path, ask: Ask) -> None:
    """Neither for that of another signature, nor for that of new sources."""
    tree = copied(tmp_path)
    caller = tree / "outside" / "caller.py"
    source = "from minisim.jit import njit\n@njit\ndef answer(x): return x // 4\n"
    caller.write_text(source)
    assert ask(tree) == "2.0 compiled"
    whole = ASK.replace("10.0", "10")
    ask(tree, KILLED)
    assert ask(tree, whole).split()[0] == "2"
    caller.write_text(source.replace("x // 4", "-x // 4"))
    ask(tree, KILLED)
    assert ask(tree, whole).split()[0] == "-3"


def test_code_of_old_sources_does_not_stay(tmp_path: Path, ask: Ask) -> None:
    tree = copied(tmp_path)
    for factor in (1.0, 2.0):
        write(tree, factor=factor)
        assert ask(tree) == f"{10.0 + factor} compiled"
    assert len(list((tmp_path / "kept").rglob("caller.answer-*.nbc"))) == 1


#: Who has compiled `rule`: this process, or another.
WITH_PARTS = """
from minisim.jit import njit_with
from outside.rule import rule

@njit_with(rule)
def answer(x: float) -> float:
    return rule(x) + 0.5
"""

ASK_WITH_PARTS = """
from outside.caller import answer
from outside.rule import rule
print(answer(10.0), rule(2.0), "kept" if rule.stats.cache_hits else "compiled")
"""

FAILURES = {
    "one core": "import minisim.apart; minisim.apart.cores = lambda: 1\n",
    "a frozen application": "import sys; sys.frozen = True\n",
    "no interpreter": "import sys; sys.executable = None\n",
    "another process that fails": "import sys; sys.executable = '/bin/false'\n",
    "another process that is never there": "import sys; sys.executable = '/no/python'\n",
}


def with_parts(folder: Path) -> Path:
    tree = copied(folder)
    write(tree, decorator="njit_apart", body="x * 2.0")
    (tree / "outside" / "caller.py").write_text(WITH_PARTS)
    return tree


@pytest.mark.skipif(apart.cores() == 1, reason="there is no second core for a second process")
def test_a_second_process_compiles_parts(tmp_path: Path, ask: Ask) -> None:
    assert ask(with_parts(tmp_path), ASK_WITH_PARTS) == "20.5 4.0 kept"


@pytest.mark.parametrize("failure", FAILURES.values(), ids=FAILURES)
def test_without_a_second_process_all_is_compiled_here(
    tmp_path: Path, ask: Ask, failure: str
) -> None:
    tree = with_parts(tmp_path)
    assert ask(tree, failure + ASK_WITH_PARTS) == "20.5 4.0 compiled"
    assert ask(tree, failure + ASK_WITH_PARTS) == "20.5 4.0 kept"


#: A numba without a part that it does not promise.
OTHER_NUMBA = """
import numba.core.caching
del numba.core.caching.IndexDataCacheFile._save_data
"""

SHORT = """
from minisim import simulate
from dim import Dim
from scenarios import four_way
print(simulate(four_way(350, horizon=60), Dim(), seed=1).columns.travel_time.tolist())
"""


def test_an_unknown_numba_is_told_and_compiles_without_its_inner_parts(tmp_path: Path) -> None:
    tree = copied(tmp_path)
    write(tree)
    kept = {"PYTHONPATH": str(tree), "NUMBA_CACHE_DIR": str(tree / "kept")}
    for _ in range(2):
        done = python("-c", OTHER_NUMBA + ASK, cwd=tree, **kept)
        assert done.stdout == "10.5 compiled\n"
        assert "UserWarning: minisim does not know numba" in done.stderr
    assert not (tree / "kept").exists()


@pytest.mark.slow  # compiles the whole engine
def test_runs_are_the_same_with_an_unknown_numba() -> None:
    other = python("-W", "ignore", "-c", OTHER_NUMBA + SHORT)
    assert other.stderr == ""
    assert other.stdout == python("-c", SHORT).stdout
