"""TTC, DRAC, PET and braking of whole recordings; by hand, see `test_encounters`."""

from __future__ import annotations

from typing import Any

import pandas as pd
import pytest

import minisim
from baselines import FixedTime
from minisim.control import Unregulated
from minisim.errors import InputError
from minisim.results.encounters import crossings, encroachments, following
from minisim.results.safety import high_drac, safety_summary, short_pet, short_ttc
from minisim.testing import small_scenario
from scenarios import four_way
from tests.builders import at, driven, frame_of, glide, replayed

SITE = small_scenario(4).site(0)
NOTHING = {
    **dict.fromkeys(("min_ttc_s", "min_pet_s", "max_drac_mps2", "max_braking_mps2")),
    **dict.fromkeys(("pets", "pets_below_1_s", "pets_below_1_5_s", "pets_below_2_s"), 0),
}


def test_close_calls_are_of_the_one_behind_or_second() -> None:
    """Vehicle 1 follows 0 and closes in; 3 crosses the way of 2 after it, 1.5 s or 2.5 s later."""
    trips = [(0.0, 0, 2), (1.0, 0, 2), (2.0, 1, 2), (3.0, 2, 2)]
    run = minisim.simulate(replayed(four_way(0), *trips, horizon=30.0), FixedTime(), record="all")
    entry = run.site.intersection.approach_length
    near = (0, 10, entry - 40.0, 5.0, 0.0), (1, 10, entry - 53.0, 13.0, 0.0)  # 8 m at 8 m/s
    for later, short in ((1.5, 1.0), (2.5, 0.0)):
        lines = [
            (vehicle, tick, entry + tick - start, 10.0, 0.0)
            for vehicle, start in ((2, 230.0), (3, 230.0 + 10 * later))
            for tick in range(170, 290)
        ]
        told = driven(run, *near, *lines)
        assert short_ttc(told).tolist() == [0, 1, 0, 0], "8 m at 8 m/s: 1 s"
        assert high_drac(told).tolist() == [0, 1, 0, 0], "64/16 m/s²"
        assert short_pet(told).tolist() == [0, 0, 0, short]
    summary = told.summary(["short_ttc", "short_pet", "high_drac"])["complete"]
    assert [summary[name] for name in ("short_ttc", "short_pet", "high_drac")] == [0.25, 0, 0.25]


def test_braking_is_the_strongest_of_all() -> None:
    frame = frame_of(
        at(1, "a2", -80.0, 5.0, a=-3.5, row=False),
        at(2, "b2", -80.0, 5.0, a=1.0, row=False),
    )
    assert safety_summary(frame, SITE) == NOTHING | {"max_braking_mps2": 3.5}
    assert safety_summary(frame.iloc[1:], SITE)["max_braking_mps2"] == 0.0


def test_nothing_happens_on_an_empty_recording() -> None:
    assert safety_summary(frame_of(), SITE) == NOTHING
    for monitor in (following, encroachments, crossings):
        assert len(monitor(frame_of(), SITE)) == 0


def test_the_order_of_the_rows_does_not_matter() -> None:
    rows = [
        *glide(1, "a2", 10.0, 10.0),
        *glide(2, "b2", 11.0, 10.0),
        *glide(3, "a1", 14.0, 8.0),
    ]
    frame = frame_of(*rows)
    shuffled = frame.sample(frac=1.0, random_state=0)
    assert safety_summary(shuffled, SITE) == safety_summary(frame, SITE)


def test_a_signal_is_safe_and_anarchy_is_not() -> None:
    scenario = small_scenario(4, density=300, demand_time=240.0)
    safe = minisim.simulate(scenario, FixedTime(), seed=1, record="junction")
    wild = minisim.simulate(scenario, Unregulated(), 1, record="junction", on_collision="record")
    calm: dict[str, Any] = dict(safety_summary(safe.trajectories, safe.site))
    assert calm["pets"] > 50
    assert calm["min_pet_s"] > 1.0
    assert len(crossings(safe.trajectories, safe.site)) == 0
    assert 1.0 < calm["max_braking_mps2"] < 6.0
    # Two vehicles of different arms that collide are in the conflict area together.
    touched = {c.vehicles for c in wild.collisions if c.movements[0][0] != c.movements[1][0]}
    assert touched
    pets = encroachments(wild.trajectories, wild.site)
    overlapping = pets[pets["pet_s"] <= 0.0][["first", "second"]].to_numpy().tolist()
    assert touched & {(min(pair), max(pair)) for pair in overlapping}
    assert len(crossings(wild.trajectories, wild.site)) > 0


@pytest.mark.parametrize(
    ("frame", "message"),
    [(pd.DataFrame({"time_s": [0.0]}), "no column vehicle"), ("trips", "DataFrame")],
)
def test_another_frame_is_a_clear_error(frame: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        safety_summary(frame, SITE)
    with pytest.raises(InputError, match="site must be a Site"):
        safety_summary(frame_of(), "four-way")  # type: ignore[arg-type]
