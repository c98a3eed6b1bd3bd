"""A user at a terminal is told that compiling takes long, and only then."""

from __future__ import annotations

import io
from pathlib import Path
from types import SimpleNamespace

import pytest

import minisim
import minisim.jit
from dim import Dim
from minisim.compiling import announce, announce_if_new
from scenarios import four_way

pytestmark = pytest.mark.skipif(not minisim.jit.COMPILED, reason="numba is missing or off")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """What this process says at a terminal, to which it has said nothing yet."""
    announce.cache_clear()
    terminal = Terminal()
    # pytest's own stderr comes back between this fixture and its test.
    monkeypatch.setattr("minisim.compiling.sys", SimpleNamespace(stderr=terminal))
    return terminal


def test_it_is_told_once_where_nothing_is_kept(
    terminal: Terminal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    announce_if_new()
    announce_if_new()
    assert terminal.getvalue().count("compiling, once after installation") == 1


def test_nothing_is_told_where_the_kernel_is_kept(terminal: Terminal) -> None:
    minisim.simulate(four_way(150, horizon=1), Dim(), seed=1)
    announce_if_new()
    assert terminal.getvalue() == ""


@pytest.mark.parametrize("reason", ["switched off", "no terminal"])
def test_nothing_is_told_without_compiling_or_a_terminal(
    terminal: Terminal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reason: str
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    if reason == "switched off":
        monkeypatch.setenv("MINISIM_JIT", "0")
    else:
        monkeypatch.setattr(terminal, "isatty", lambda: False)
    announce_if_new()
    assert terminal.getvalue() == ""
