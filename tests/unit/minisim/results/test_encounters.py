"""Followings, encroachments and crossing courses against situations worked out by hand.

The hand calculations use the 4-arm junction of `small_scenario`: left-hand traffic, lanes of
3.2 m, entries 7.2 m from the centre, cars of 5 × 1.8 m. Lanes from the north lie at x = 1.6, those
from the east at y = −1.6.
"""

from __future__ import annotations

import numpy as np
import pytest

from minisim.junction.conflicts import conflict_areas
from minisim.junction.movements import Movement
from minisim.junction.partings import branch
from minisim.results.encounters import crossings, encroachments, following
from minisim.results.safety import safety_summary
from minisim.testing import small_scenario
from tests.builders import at, frame_of, glide

SITE = small_scenario(4).site(0)
ENTRY = SITE.intersection.approach_length


def test_ttc_and_drac_behind_a_slower_leader() -> None:
    frame = frame_of(at(1, "a2", -80.0, 10.0), at(2, "a1", -100.0, 15.0))
    (row,) = following(frame, SITE).to_dict("records")
    # Gap 20 − 5 m, closing at 5 m/s.
    assert (row["follower"], row["leader"]) == (2, 1)
    assert row["gap_m"] == pytest.approx(15.0)
    assert row["ttc_s"] == pytest.approx(3.0)
    assert row["drac_mps2"] == pytest.approx(5.0**2 / 30.0)


@pytest.mark.parametrize(
    ("leader", "follower", "ttc"),
    [((-80.0, 15.0), (-100.0, 10.0), np.nan), ((-80.0, 5.0), (-84.0, 10.0), 0.0)],
    ids=["a faster leader", "bodies that overlap"],
)
def test_without_closing_in_or_a_gap_there_is_no_drac(
    leader: tuple[float, float], follower: tuple[float, float], ttc: float
) -> None:
    frame = frame_of(at(1, "a2", *leader), at(2, "a2", *follower))
    (row,) = following(frame, SITE).to_dict("records")
    assert row["ttc_s"] == pytest.approx(ttc, nan_ok=True)
    assert np.isnan(row["drac_mps2"])
    assert safety_summary(frame, SITE)["min_ttc_s"] == (None if np.isnan(ttc) else ttc)


def test_each_follows_the_one_ahead_at_the_same_time_and_lane() -> None:
    frame = frame_of(
        at(3, "a2", -30.0, 5.0), at(1, "a1", -10.0, 5.0), at(2, "a3", -20.0, 5.0),
        at(4, "b2", -25.0, 5.0), at(1, "a1", -9.5, 5.0, time=0.1), at(4, "b2", -24.5, 5, time=0.1),
    )  # fmt: skip
    pairs = following(frame, SITE)[["time_s", "follower", "leader"]].to_numpy().tolist()
    assert sorted(pairs) == [[0.0, 2, 1], [0.0, 3, 2]]


def test_a_leader_that_has_turned_off_is_none() -> None:
    # a1 turns left; a2 goes straight on. Once the rear of a1 is past their branch, a2 is free.
    a1, a2 = map(SITE.intersection.index, ("a1", "a2"))
    parts = branch(SITE.intersection, SITE.vehicle)[a1, a2] - ENTRY
    follower = at(2, "a2", -3.0, 8.0)
    for beyond, led in ((-0.1, 1), (0.1, 0)):
        frame = frame_of(at(1, "a1", parts + 5.0 + beyond, 4.0), follower)
        assert len(following(frame, SITE)) == led


def test_behind_one_that_has_turned_off_the_next_one_ahead_counts() -> None:
    # The first of a2 drives on slowly, a1 has turned off in between, the second of a2 follows.
    path = SITE.intersection.path(Movement(0, 1))
    beyond = path.exit - ENTRY + 20.0
    ahead = at(1, "a2", beyond + 30.0, 5.0), at(2, "a1", beyond, 5.0)
    frame = frame_of(*ahead, at(3, "a2", -1.0, 10.0))
    (row,) = following(frame, SITE).to_dict("records")
    assert (row["follower"], row["leader"]) == (3, 1)
    assert row["gap_m"] == pytest.approx(beyond + 30.0 - 5.0 + 1.0)


def test_the_leader_may_come_from_another_arm_into_the_same_exit() -> None:
    # d2 (straight on) and a1 (left) both leave by b.
    d2, a1 = (SITE.intersection.paths[SITE.intersection.index(m)] for m in ("d2", "a1"))
    assert d2.exit_arm == a1.exit_arm == 1
    frame = frame_of(
        at(1, "d2", d2.exit - ENTRY + 12.0, 6.0), at(2, "a1", a1.exit - ENTRY - 2.0, 8.0),
        at(3, "a1", -30.0, 8.0), at(4, "c2", 5.0, 8.0),
    )  # fmt: skip
    rows = following(frame, SITE).set_index("follower")
    assert rows.loc[2, "leader"] == 1
    assert rows.loc[2, "gap_m"] == pytest.approx(12.0 - 5.0 + 2.0)
    assert rows.loc[2, "ttc_s"] == pytest.approx(9.0 / 2.0)
    assert rows.loc[3, "leader"] == 2
    assert 4 not in rows.index


def test_past_the_junction_each_still_follows_only_once() -> None:
    frame = frame_of(at(1, "a2", 30.0, 5.0), at(2, "a2", 20.0, 10.0))
    (row,) = following(frame, SITE).to_dict("records")
    assert (row["follower"], row["leader"], row["gap_m"]) == (2, 1, pytest.approx(5.0))


@pytest.mark.parametrize(("headway", "pet"), [(3.0, 2.0), (1.5, 0.5), (0.8, -0.2)])
def test_pet_of_two_crossing_vehicles(headway: float, pet: float) -> None:
    # At 10 m/s a2 leaves the area 1.47 s after its entry, b2 enters it 0.47 s after its own.
    frame = frame_of(*glide(1, "a2", 10.0, 10.0), *glide(2, "b2", 10.0 + headway, 10.0))
    (row,) = encroachments(frame, SITE).to_dict("records")
    assert (row["first"], row["second"]) == (1, 2)
    assert row["time_s"] == pytest.approx(10.0 + headway + 0.47, abs=0.01)
    summary = safety_summary(frame, SITE)
    assert summary["min_pet_s"] == pytest.approx(pet, abs=0.02)
    assert summary["pets_below_1_s"] == (pet < 1.0)
    assert summary["pets_below_1_5_s"] == (pet < 1.5)


def test_pet_of_merging_vehicles_ends_when_the_first_is_clear() -> None:
    # d2 is clear (rear past the exit) after 14.4 + 5 m; then a1 begins.
    frame = frame_of(*glide(1, "d2", 10.0, 10.0), *glide(2, "a1", 13.0, 5.0))
    (row,) = encroachments(frame, SITE).to_dict("records")
    areas = conflict_areas(SITE.intersection, SITE.vehicle)
    enter = areas.enter[0, SITE.intersection.index("d2")] - ENTRY
    assert row["pet_s"] == pytest.approx(13.0 + enter / 5.0 - (10.0 + 1.94), abs=0.02)


def test_only_the_next_vehicle_through_the_area_encroaches() -> None:
    frame = frame_of(
        *glide(1, "a2", 10.0, 10.0), *glide(2, "a2", 12.0, 10.0), *glide(3, "b2", 15.0, 10.0),
        *glide(4, "b2", 17.0, 10.0), *glide(5, "a2", 20.0, 10.0),
    )  # fmt: skip
    pairs = encroachments(frame, SITE)[["first", "second"]].to_numpy().tolist()
    assert pairs == [[2, 3], [4, 5]]


def test_harmonious_vehicles_do_not_encroach() -> None:
    # a1 and c1 turn left, each into its own exit.
    frame = frame_of(*glide(1, "a1", 10.0, 5.0), *glide(2, "c1", 10.5, 5.0))
    assert len(encroachments(frame, SITE)) == 0
    assert safety_summary(frame, SITE)["min_pet_s"] is None


def test_a_vehicle_that_stays_in_the_area_leaves_it_at_the_end_of_its_recording() -> None:
    stuck = [at(1, "a2", 9.0, 0.0, time=t / 10.0) for t in range(100, 200)]
    arriving = [at(1, "a2", t - 101.0, 10.0, time=(t - 11) / 10.0) for t in range(90, 111)]
    frame = frame_of(*arriving, *stuck, *glide(2, "b2", 15.0, 10.0))
    (row,) = encroachments(frame, SITE).to_dict("records")
    # b2 enters at 15.47 s; a2 is last seen, inside, at 19.9 s.
    assert row["pet_s"] == pytest.approx(15.47 - 19.9, abs=0.02)


def test_a_vehicle_whose_entry_is_not_recorded_does_not_count() -> None:
    late = [row for row in glide(1, "a2", 10.0, 10.0) if row["time_s"] > 11.0]
    frame = frame_of(*late, *glide(2, "b2", 13.0, 10.0))
    assert len(encroachments(frame, SITE)) == 0


def test_crossing_ttc_is_the_time_of_the_second_to_the_area() -> None:
    # a2: 2.9 m and 9.7 m to enter and leave at 10 m/s, so inside from 0.29 to 0.97 s.
    # b2: 4.7 m to enter at 8 m/s, 0.5875 s.
    frame = frame_of(at(1, "a2", 5.0, 10.0), at(2, "b2", 0.0, 8.0))
    (row,) = crossings(frame, SITE).to_dict("records")
    assert (row["first"], row["second"]) == (1, 2)
    assert row["ttc_s"] == pytest.approx(0.5875, abs=0.02)
    assert safety_summary(frame, SITE)["min_ttc_s"] == row["ttc_s"]
    # At 4 m/s b2 needs 1.175 s, so a2 has left; a2 that stands inside is met for sure.
    assert len(crossings(frame_of(at(1, "a2", 5.0, 10.0), at(2, "b2", 0.0, 4.0)), SITE)) == 0
    met = crossings(frame_of(at(1, "a2", 9.0, 0.0), at(2, "b2", -5.0, 10.0)), SITE)
    assert met["ttc_s"].tolist() == pytest.approx([0.97], abs=0.02)


def test_a_vehicle_without_right_of_way_is_on_no_crossing_course() -> None:
    # Inside the junction it crosses, with or without right of way.
    for s, row, crosses in ((-1.0, False, 0), (-1.0, True, 1), (0.1, False, 1)):
        frame = frame_of(at(1, "a2", 5.0, 10.0), at(2, "b2", s, 8.0, row=row))
        assert len(crossings(frame, SITE)) == crosses
