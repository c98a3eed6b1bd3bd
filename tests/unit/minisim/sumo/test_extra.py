"""Without the extra `sumo` everything else works, and a run in SUMO says what to install."""

from __future__ import annotations

import sys

import pytest

from minisim.control import Unregulated
from minisim.errors import MissingExtraError
from minisim.sumo import simulate
from minisim.testing import check_controller, small_scenario
from tests.builders import python

INSTALL = r"needs the package \w+: pip install 'minisim-traffic\[sumo\]'"


@pytest.mark.parametrize("package", ["libsumo", "sumo"])
def test_the_install_command_is_told(monkeypatch: pytest.MonkeyPatch, package: str) -> None:
    monkeypatch.setitem(sys.modules, package, None)  # Python's own way to block an import
    with pytest.raises(MissingExtraError, match=INSTALL):
        simulate(small_scenario(), Unregulated())
    with pytest.raises(MissingExtraError, match=INSTALL):
        check_controller(Unregulated(), host="sumo")


def test_the_rest_works_without_the_extra() -> None:
    code = (
        "import sys\n"
        "for name in ('libsumo', 'sumo', 'sumolib', 'traci'): sys.modules[name] = None\n"
        "import minisim.sumo\n"
        "from scenarios.cli import main\n"
        "assert main(['run', 'four-way', '--horizon', '20']) == 0\n"
        "sys.exit(main(['run', 'four-way', '--horizon', '20', '--host', 'sumo']))"
    )
    done = python("-c", code)
    assert done.returncode == 2
    assert "pip install 'minisim-traffic[sumo]'" in done.stderr
    assert done.stderr.count("\n") == 1, "one line"
