"""`import minisim` is quick and loads no heavy library; the rooms keep their walls."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

import minisim
from tests import ROOT

HEAVY = {"numpy", "pandas", "numba", "matplotlib", "shapely", "networkx", "pymunk", "scipy"}

PROBE = """
import json, sys, time
start = time.process_time()
import minisim
print(json.dumps([time.process_time() - start, sorted(sys.modules)]))
"""


def python(code: str) -> str:
    """Standard output of the code in a fresh interpreter."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.check_output([sys.executable, "-c", code], text=True, env=environment)


def test_importing_minisim_is_quick_and_loads_nothing_heavy() -> None:
    seconds, modules = json.loads(python(PROBE))
    assert seconds < 0.5
    assert HEAVY.isdisjoint(modules)


@pytest.mark.parametrize("name", minisim.__all__)
def test_every_public_name_of_minisim_can_be_used(name: str) -> None:
    assert getattr(minisim, name) is not None
    assert name in dir(minisim)


def test_unknown_names_are_attribute_errors() -> None:
    with pytest.raises(AttributeError, match="module 'minisim' has no attribute 'simulat'"):
        minisim.simulat  # noqa: B018


@pytest.mark.parametrize("room", ["dim", "baselines"])
def test_controllers_do_not_load_the_engine(room: str) -> None:
    """What import-linter proves of the source holds when it runs, too."""
    modules = set(
        json.loads(python(f"import json, sys, {room}; print(json.dumps([*sys.modules]))"))
    )
    assert {"minisim.simulation", "minisim.engine.state", "minisim.engine.kernel"}.isdisjoint(
        modules
    )
    assert {"pymunk", "matplotlib", "figures", "scenarios"}.isdisjoint(modules)


def test_the_command_line_draws_only_when_asked() -> None:
    modules = json.loads(
        python("import json, sys, scenarios.cli; print(json.dumps([*sys.modules]))")
    )
    assert "matplotlib" not in modules
