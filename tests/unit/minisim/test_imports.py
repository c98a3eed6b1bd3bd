"""`import minisim` is quick and loads no heavy library; the rooms keep their walls."""

from __future__ import annotations

import json

import pytest

import minisim
from tests.builders import python

HEAVY = {"numpy", "pandas", "numba", "matplotlib", "shapely", "networkx", "pymunk", "scipy"}

PROBE = """
import json, sys, time
start = time.process_time()
import {}
print(json.dumps([time.process_time() - start, sorted(sys.modules)]))
"""


def imported(name: str) -> tuple[float, set[str]]:
    """Processor time of an import in a fresh interpreter [s], and the modules that it loads."""
    seconds, modules = json.loads(python("-c", PROBE.format(name)).stdout)
    return seconds, set(modules)


def test_importing_minisim_is_quick_and_loads_nothing_heavy() -> None:
    seconds, modules = imported("minisim")
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
    _, modules = imported(room)
    assert {"minisim.simulation", "minisim.engine", "minisim.results", "pymunk"}.isdisjoint(modules)
    assert {"matplotlib", "figures", "scenarios"}.isdisjoint(modules)


def test_the_command_line_draws_only_when_asked() -> None:
    assert "matplotlib" not in imported("scenarios.cli")[1]
