"""Tests in this folder need SUMO: they are marked, and skipped where it is missing."""

from __future__ import annotations

import importlib.util
import os
import socket
import subprocess
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import minisim
from minisim.control import Controller
from minisim.results.run import Run
from minisim.sumo import network, process, simulate
from tests.sumo.forking import Forked, forking

NEEDED = ("libsumo", "sumo", "sumolib")
MISSING = [name for name in NEEDED if importlib.util.find_spec(name) is None]
REASON = f"{', '.join(MISSING)} not installed: pip install 'minisim-traffic[sumo]'"


def both(scenario: Any, controller: Controller, seed: int = 0, **options: Any) -> tuple[Run, Run]:
    """The same run in minisim and in SUMO."""
    ours = minisim.simulate(scenario, controller, seed, **options)
    return ours, simulate(scenario, controller, seed, **options)


@pytest.fixture(scope="session")
def server() -> Iterator[socket.socket]:
    """The process of which SUMO's processes are forks."""
    with forking() as server:
        yield server


@pytest.fixture(autouse=True)
def _quick_starts(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Load SUMO once, and build no network twice."""
    monkeypatch.setattr(network, "run_tool", converted)
    if hasattr(os, "fork"):
        popen = partial(Forked, request.getfixturevalue("server"))
        monkeypatch.setattr(
            process, "subprocess", SimpleNamespace(Popen=popen, PIPE=subprocess.PIPE)
        )


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> None:
    """SUMO's processes are started as users start them."""
    monkeypatch.setattr(process, "subprocess", subprocess)
    monkeypatch.setattr(network, "run_tool", RUN_TOOL)


RUN_TOOL = network.run_tool
INPUTS = network.NODES, network.EDGES, network.CONNECTIONS
NETWORKS: dict[object, bytes] = {}


def converted(command: list[str], folder: Path, home: Path) -> None:
    """The host's network as netconvert builds it, or has built it from the same files."""
    if network.NETWORK not in command:
        RUN_TOOL(command, folder, home)
        return
    key = (*command, *((folder / name).read_bytes() for name in command if name in INPUTS))
    if key not in NETWORKS:
        RUN_TOOL(command, folder, home)
        NETWORKS[key] = (folder / network.NETWORK).read_bytes()
    (folder / network.NETWORK).write_bytes(NETWORKS[key])


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker("sumo")
            if MISSING:
                item.add_marker(pytest.mark.skip(reason=REASON))
