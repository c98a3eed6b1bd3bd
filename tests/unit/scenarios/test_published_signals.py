"""The published runs of the signals against SUMO 1.18 on the same arrivals.

How the numbers were recorded: SUMO 1.18.0 (eclipse-sumo and libsumo of that version, in an
environment of their own) ran its own `static`, `delay_based` or `actuated` program on the authors'
network of that run, with the published arrivals and speed factors, departPos "base", departSpeed 0
and steps of 0.01 s. At unequal inflow, the fixed-time signal's vehicles were `CC` under ACC with a
headway of 1.5 s in speed mode 31; the means of those runs are the published ones to the last digit.
These trips are the first of each run, from `tripinfo`. `tests/sumo/test_published.py` runs 1.18
again where it is installed, but not for the signals.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import minisim
from baselines.signals.heads import Heads
from minisim.control import View
from minisim.errors import InputError
from minisim.vehicle import VehicleType
from scenarios.paper import controller_of, replay

#: Run -> duration and waiting time of its first trips in SUMO 1.18 [s].
TRIPS = {
    ("balanced", "fts"): [
        (71.73, 3.96), (77.72, 1.79), (81.44, 10.35), (88.44, 21.57), (84.87, 10.54), (86.73, 0.0),
        (72.41, 3.65), (102.74, 21.71), (84.72, 8.79), (103.76, 20.35), (86.78, 20.86),
        (104.01, 15.65),
    ],
    ("balanced", "ats"): [
        (83.37, 15.96), (91.14, 14.79), (83.69, 7.9), (79.99, 8.04), (79.74, 10.01), (91.82, 5.89),
        (81.41, 12.65), (87.88, 7.71), (79.01, 0.0), (84.3, 1.35), (76.78, 10.86), (80.56, 0.0),
    ],
    ("4:3:2:1", "fts"): [
        (94.46, 19.13), (78.47, 3.13), (78.41, 0.16), (96.46, 21.13), (88.09, 13.13), (80.31, 0.16),
        (79.73, 0.16), (95.47, 16.71), (75.78, 0.16), (73.42, 0.16), (100.47, 21.18), (96.59, 0.16),
    ],
    ("4:3:2:1", "ats"): [
        (67.25, 0.0), (84.14, 7.79), (71.06, 0.35), (76.74, 10.57), (71.99, 0.0), (85.81, 0.0),
        (70.0, 0.0), (94.74, 13.71), (91.46, 8.97), (93.07, 3.81), (86.72, 2.05), (91.33, 0.45),
    ],
    ("4:1:4:1", "ats"): [
        (67.25, 0.0), (87.72, 11.79), (85.74, 6.99), (81.25, 5.11), (70.36, 1.01), (90.35, 0.0),
        (74.88, 6.47), (80.49, 0.0), (80.96, 4.61), (85.01, 1.17),
    ],
}  # fmt: skip

#: When the adaptive signal at 4:1:4:1 switched from the second green on [s]; times off the whole
#: second come from vehicles that prolong a green.
SWITCHES = [27.0, 29.0, 34.0, 36.0, 39.0, 41.0, 44.0, 46.0, 49.0, 51.0, 54.82, 56.82, 68.82, 70.82]


@pytest.mark.parametrize(("split", "who"), TRIPS)
def test_the_first_trips_are_those_of_sumo(split: str, who: str) -> None:
    scenario = replace(replay(split, 150, 4, who), horizon=180.0)
    run = minisim.simulate(scenario, controller_of(split, 150, 4, who), on_collision="record")
    trips = TRIPS[split, who]
    ours = np.stack([run.columns.travel_time, run.columns.waiting_time], axis=-1)[: len(trips)]
    assert ours == pytest.approx(np.array(trips), abs=0.021)


def test_the_adaptive_signal_switches_with_sumo(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its timers count milliseconds, and a loss of time is relative to the driver's own speed."""
    seen: list[float] = []
    show = Heads.show

    def spy(self: Heads, view: View, wanted: list) -> list:  # type: ignore[type-arg]
        before = list(self.colours)
        commands = show(self, view, wanted)
        if self.colours != before:
            seen.append(view.time)
        return commands

    monkeypatch.setattr(Heads, "show", spy)
    scenario = replace(replay("4:1:4:1", 150, 4, "ats"), horizon=75.0)
    minisim.simulate(scenario, controller_of("4:1:4:1", 150, 4, "ats"), on_collision="record")
    assert seen[1 : len(SWITCHES) + 1] == pytest.approx(SWITCHES, abs=1e-6)


def test_a_vehicle_on_the_very_line_stops_at_amber() -> None:
    """SUMO 1.18, adaptive, balanced 150: vehicle 79 (d1) slows for its turn, to the line."""
    scenario = replace(replay("balanced", 150, 4, "ats"), horizon=530.0)
    signal = controller_of("balanced", 150, 4, "ats")
    run = minisim.simulate(scenario, signal, on_collision="record")
    trip = run.columns.travel_time[79], run.columns.waiting_time[79]
    assert trip == pytest.approx((86.62, 17.0), abs=0.021)


def test_at_4141_300_the_fixed_time_signal_had_the_green_that_the_table_prints() -> None:
    assert controller_of("4:1:4:1", 300, 4, "fts").greens == 19.75  # type: ignore[attr-defined]
    assert controller_of("balanced", 300, 4, "fts").greens == 19.25  # type: ignore[attr-defined]


def test_replays_for_the_installed_host_keep_to_minisims_own_rules() -> None:
    assert replay("balanced", 150, 4, "fts", sumo="1.28").profile.vehicle.sumo is None
    assert not replay("4:3:2:1", 150, 4, "fts", sumo="1.28").profile.vehicle.obeys  # type: ignore[attr-defined]


def test_only_krauss_drives_like_a_version_of_sumo() -> None:
    with pytest.raises(InputError, match="krauss"):
        VehicleType(sumo="1.18")


def test_past_a_red_light_a_vehicle_is_quick_to_pass_its_waiting_position() -> None:
    """The 55th trip turns far as its light turns red, and brakes no more."""
    run = minisim.simulate(
        replace(replay("4:1:4:1", 150, 4, "fts"), horizon=400.0),
        controller_of("4:1:4:1", 150, 4, "fts"), on_collision="record",
    )  # fmt: skip
    assert run.columns.arrival[54] == pytest.approx(393.21, abs=0.015)
