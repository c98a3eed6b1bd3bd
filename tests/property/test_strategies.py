"""The strategies that users get: all that they draw can be simulated, safely."""

from __future__ import annotations

from hypothesis import given

from minisim import simulate
from minisim.control import Controller
from scenarios import Scenario
from scenarios.strategies import controllers, scenarios
from tests.builders import python, share


@share(0.5)
@given(scenarios(horizon=90.0), controllers())
def test_nothing_collides(scenario: Scenario, controller: Controller) -> None:
    assert not simulate(scenario, controller).collisions


def test_without_hypothesis_the_error_says_what_to_install() -> None:
    code = (
        "import sys; sys.modules['hypothesis'] = None\n"
        "from minisim.errors import MissingExtraError\n"
        "try:\n"
        "    import scenarios.strategies\n"
        "except MissingExtraError as error:\n"
        "    print(error)\n"
    )
    told = python("-c", code).stdout
    assert told == "strategies need hypothesis: pip install 'minisim-traffic[testing]'\n"
