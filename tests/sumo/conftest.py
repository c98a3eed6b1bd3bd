"""Tests in this folder need SUMO: they are marked, and skipped where it is missing."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

MISSING = [
    name for name in ("libsumo", "sumo", "sumolib") if importlib.util.find_spec(name) is None
]
REASON = f"{', '.join(MISSING)} not installed: pip install 'minisim[sumo]'"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker("sumo")
            if MISSING:
                item.add_marker(pytest.mark.skip(reason=REASON))
