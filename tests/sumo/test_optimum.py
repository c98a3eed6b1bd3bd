"""The bound holds in SUMO, too, and the schedule can be driven there."""

import pytest

from baselines import V2IC, Reservation
from minisim.sumo import simulate
from scenarios.library import four_way
from scenarios.optimum import compared, optimum
from scenarios.profiles import FAIR, PAPER, Profile


@pytest.mark.parametrize(
    "profile", [PAPER, pytest.param(FAIR, marks=pytest.mark.slow)], ids=lambda it: it.name
)
def test_no_controller_has_less_delay_than_the_bound(profile: Profile) -> None:
    scenario = four_way(profile=profile, density=250.0, horizon=60.0)
    least = optimum(scenario)
    rows = list(compared(scenario, [Reservation(), V2IC()], 0, least, simulate))
    assert [row["error"] for row in rows] == ["", "", ""]
    assert all(row["delay_s"] >= least.bound for row in rows)
    assert rows[0]["delay_s"] < rows[2]["delay_s"]
