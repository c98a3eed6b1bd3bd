"""mutmut, with a faster way to run the tests; `make mutants`.

    python tests/mutants.py run ['dim.zones*' …]   # test the mutants that have no verdict yet
    python tests/mutants.py results                # those that survived
    python tests/mutants.py show MUTANT            # what was changed
    python tests/mutants.py table                  # how many, by module
    python tests/mutants.py sample 80              # names of mutants drawn at random, to `run`

mutmut itself has pytest collect the tests again for every mutant, which takes longer than running
them. Here they are collected once, and each mutant is tried in a fork of that process by the tests
that reach the changed function, fast ones first, up to the first that fails.
"""

from __future__ import annotations

import itertools
import json
import os
import random
import signal
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click
import mutmut.workers.isolation
import pytest
from _pytest.config import _prepareconfig
from mutmut.__main__ import cli
from mutmut.runners.harness import PytestRunner
from mutmut.state import state
from mutmut.stats import status_by_exit_code
from mutmut.utils.file_utils import change_cwd
from scipy.stats import binomtest

from minisim.files import markdown_table

#: Each mutant gets the tests that take so many seconds with the original.
BUDGET = float(os.environ.get("MUTANTS_BUDGET", "12"))

#: CPU time that a test may take with a mutant [s]: so much, and so many times its usual time.
LEAST, FACTOR = 4.0, 4.0

#: pytest's exit code when a test fails, and mutmut's for a mutant that hangs.
FAILS, HANGS = 1, 36


class EmptyCaches:
    """A plugin of pytest that empties the caches of `dim` before each test.

    A cached answer would hide a mutant, and that the test reaches the function behind it.
    """

    def pytest_runtest_setup(self) -> None:
        for name, module in list(sys.modules.items()):
            if name.partition(".")[0] == "dim":
                for value in vars(module).values():
                    if hasattr(value, "cache_clear"):
                        value.cache_clear()


class Collected(PytestRunner):
    """Runs tests that were collected once."""

    def warm_up(self) -> None:
        """Collect all tests, and see in a fork that the original passes them."""
        # mutmut leaves a file open in each fork, and pytest would blame that on some test.
        args = ["--rootdir=.", "-q", "-p", "no:unraisableexception", *self._pytest_add_cli_args]
        with change_cwd("mutants"):
            config = _prepareconfig(
                [*args, *self._pytest_add_cli_args_test_selection], [EmptyCaches()]
            )
            config._do_configure()
            self.session = pytest.Session.from_config(config)
            config.hook.pytest_sessionstart(session=self.session)
            config.hook.pytest_collection(session=self.session)
        if not (child := os.fork()):
            os._exit(self.run_tests(mutant_name="none", tests=state().duration_by_test))
        if os.waitpid(child, 0)[1]:
            raise RuntimeError("the original does not pass its tests: every mutant would be killed")

    def execute_pytest(self, params: list[str], **kwargs: Any) -> int:
        """What has to do with the original, as mutmut does it."""
        kwargs["plugins"] = [*kwargs.get("plugins", []), EmptyCaches()]
        return super().execute_pytest(params, **kwargs)

    def run_tests(self, *, mutant_name: str | None, tests: Iterable[str]) -> int:
        """0 if they pass, `FAILS` after the first that does not, or the end by `HANGS`."""
        tests = _affordable(tests)
        if mutant_name is None:
            return super().run_tests(mutant_name=None, tests=tests)
        by_name = {item.nodeid: item for item in self.session.items}
        items = [by_name[test] for test in tests]
        signal.signal(signal.SIGPROF, lambda *_: os._exit(HANGS))
        with change_cwd("mutants"):
            for item, following in zip(items, [*items[1:], None], strict=True):
                limit = LEAST + FACTOR * state().duration_by_test[item.nodeid]
                signal.setitimer(signal.ITIMER_PROF, limit)
                item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
                if self.session.testsfailed:
                    return FAILS
        return 0


def _affordable(tests: Iterable[str]) -> list[str]:
    """The fastest, as far as `BUDGET` goes."""
    durations, left, chosen = state().duration_by_test, BUDGET, []
    for test in sorted(tests, key=lambda test: (durations[test], test)):
        left -= durations[test]
        if left >= 0.0:
            chosen.append(test)
    return chosen


def _verdicts() -> dict[str, dict[str, int | None]]:
    """Module -> mutant -> exit code of its tests, None for those not tried yet."""
    return {
        path.name.removesuffix(".meta"): json.loads(path.read_bytes())["exit_code_by_key"]
        for path in sorted(Path("mutants/dim").rglob("*.py.meta"))
    }


@cli.command()
@click.argument("size", type=int)
def sample(size: int) -> None:
    """Print so many mutants of each module, drawn at random, always the same."""
    for module, codes in _verdicts().items():
        names = sorted(codes)
        for name in random.Random(module).sample(names, min(size, len(names))):
            print(name)


@cli.command()
def table() -> None:
    """Print how many mutants there are, were tried and survived, by module."""
    headings = ("module", "mutants", "tried", "killed", "survived", "score", "95 % interval")
    verdicts = {f"`{name}`": list(codes.values()) for name, codes in _verdicts().items() if codes}
    verdicts["all"] = [code for codes in verdicts.values() for code in codes]
    print(markdown_table(headings, itertools.starmap(_row, verdicts.items())))


def _row(name: str, codes: list[int | None]) -> tuple[str, ...]:
    verdicts = Counter(status_by_exit_code[code] for code in codes if code is not None)
    tried, survived = verdicts.total(), verdicts["survived"] + verdicts["no tests"]
    killed = tried - survived
    score = f"{100.0 * killed / tried:.1f} %" if tried else "–"
    low, high = binomtest(killed, tried).proportion_ci(method="wilson") if tried else (0.0, 1.0)
    counts = map(str, (len(codes), tried, killed, survived))
    return name, *counts, score, f"{100.0 * low:.0f}–{100.0 * high:.0f} %"


if __name__ == "__main__":
    mutmut.workers.isolation.PytestRunner = Collected  # type: ignore[misc]  # ours in its place
    cli()
