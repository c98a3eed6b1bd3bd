"""Tests in this folder need SUMO: they are marked, and skipped where it is missing."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import pytest

import minisim
from minisim.control import Controller
from minisim.results.run import Run
from minisim.sumo import simulate

NEEDED = ("libsumo", "sumo", "sumolib")
MISSING = [name for name in NEEDED if importlib.util.find_spec(name) is None]
REASON = f"{', '.join(MISSING)} not installed: pip install 'minisim[sumo]'"


def both(scenario: Any, controller: Controller, seed: int = 0, **options: Any) -> tuple[Run, Run]:
    """The same run in minisim and in SUMO."""
    ours = minisim.simulate(scenario, controller, seed, **options)
    return ours, simulate(scenario, controller, seed, **options)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker("sumo")
            if MISSING:
                item.add_marker(pytest.mark.skip(reason=REASON))
