"""Queues counted by hand, and the headways at which they discharge."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import minisim
from baselines import AllWayStop, FixedTime
from dim import Dim
from minisim.control import HALTING, Command, Open, Plan, View, Wake
from minisim.errors import InputError
from minisim.results.queues import (
    QUEUE_END,
    queue_lengths,
    queue_table,
    queueing,
    saturation_headways,
)
from minisim.results.run import Run
from minisim.results.tracks import whole_tracks
from minisim.vehicle import VehicleType
from scenarios import four_way
from tests.builders import Scripted, queues, replayed


def opened(lane: int, *, at: float) -> Scripted:
    """Nothing moves into the junction but from this lane, from a time on."""

    def answer(view: View) -> list[Command]:
        return [Open(lane)] if view.time >= at else [Wake(at)]

    return Scripted(answer, Plan(hold_distance=1.0))


@pytest.fixture(scope="module")
def held() -> Run:
    """Vehicles come to lane a every 10 s until 190 s; a road of 100 m is closed until 160 s."""
    scenario = four_way(0, profile="fair", arm_length=100.0)
    trips = [(10.0 * k, 0, 2) for k in range(20)]
    scenario = replayed(scenario, *trips, (0.0, 1, 2), horizon=400.0)
    return minisim.simulate(scenario, opened(0, at=160.0), record="all")


def naive(run: Run, time: float) -> Counter[str]:
    """Vehicles by lane that have been slower than 5 km/h for a second, or that wait outside."""
    frame, entry = run.trajectories, run.site.intersection.approach_length
    counts: Counter[str] = Counter()
    before = frame[(frame["time_s"] > time - 0.95) & (frame["time_s"] < time + 0.05)]
    for (_, lane), rows in before.groupby(["vehicle", "lane"], observed=True):
        slow = (rows["speed_mps"] < 5 / 3.6) & (rows["s_m"] < entry)
        counts[str(lane)] += int(len(rows) == 10 and slow.all())
    for trip in run.trips.to_dict("records"):
        entered = trip["depart_s"] if trip["depart_s"] == trip["depart_s"] else np.inf
        counts[trip["lane"]] += int(trip["demand_time_s"] <= time < entered)
    return counts


def test_a_queue_counted_by_hand(held: Run) -> None:
    """12 cars of 5 m with gaps of 2 m fill the 92 m; those that come from 120 s on wait before."""
    table = queue_table(held).set_index(["time_s", "lane"])
    assert table.loc[(4.0, "a")].tolist() == [0, 0], "on its way"
    assert table.loc[(35.0, "a"), "on_road"] == 3, "of 0, 10 and 20 s; that of 30 s drives"
    assert table.loc[(155.0, "a")].tolist() == [12, 4]
    assert table.loc[(160.0, "a")].tolist() == [12, 5]
    assert table.loc[(390.0, "a")].tolist() == [0, 0]
    assert table.loc[(390.0, "b")].tolist() == [1, 0]
    lengths = queue_lengths(held)
    assert lengths.shape == (4001, 4)
    assert (lengths.max(axis=0) == [lengths[1600:1620, 0].max(), 1, 0, 0]).all()


def test_the_metric_is_the_mean_over_time_of_each_lane_and_of_all(held: Run) -> None:
    summary, lengths = held.summary(["queue"]), queue_lengths(held)
    for lane, values in zip("abcd", lengths.T, strict=True):
        said = summary["lanes"][lane]
        assert said["queue"] == pytest.approx(values.mean())
        assert said["queue_p95"] == np.percentile(values, 95)
        assert said["queue_max"] == values.max()
    assert summary["queue"] == pytest.approx(lengths.sum(axis=1).mean())
    assert summary["queue_max"] == lengths.sum(axis=1).max()
    assert "queue" not in summary["complete"]


def test_every_moment_is_what_a_count_of_the_frame_gives() -> None:
    scenario = four_way(700, profile="fair", arm_length=120.0, horizon=240.0)
    run = minisim.simulate(scenario, FixedTime(), 3, record="all")
    table = queue_table(run)
    table["queue"] = table["on_road"] + table["before_road"]
    assert table["before_road"].max() > 0
    for time in np.arange(5.0, 240.0, 33.3).round(1).tolist():
        now = table[table["time_s"] == time].set_index("lane")["queue"]
        assert now.to_dict() == {lane: naive(run, time)[lane] for lane in "abcd"}, time


def test_the_warmup_is_left_out_but_not_its_vehicles() -> None:
    scenario = four_way(500, profile="fair", horizon=150.0, warmup=0.0)
    whole = minisim.simulate(scenario, FixedTime(), 1, record="all")
    warm = four_way(500, profile="fair", horizon=150.0, warmup=60.0)
    late = minisim.simulate(warm, FixedTime(), 1, record="all")
    np.testing.assert_array_equal(queue_lengths(late), queue_lengths(whole)[600:])
    assert late.summary(["queue"])["queue"] == pytest.approx(
        queue_lengths(whole)[600:].sum(axis=1).mean()
    )


def test_a_standing_queue_discharges_from_the_fifth_on() -> None:
    """Eight vehicles stand in lane a; those of lane b never go."""
    run = minisim.simulate(queues(VehicleType()), opened(0, at=90.0), record="all")
    frame = run.trajectories
    past = frame[(frame["lane"] == "a") & (frame["s_m"] >= run.site.intersection.approach_length)]
    enters = past.groupby("vehicle")["time_s"].min().sort_values()
    expected = enters.diff().to_numpy()
    measured = saturation_headways(run)[enters.index.to_numpy()]
    assert np.isnan(measured[:4]).all()
    np.testing.assert_allclose(measured[4:], expected[4:], atol=run.site.dt + 1e-9)
    assert np.isfinite(saturation_headways(run)).sum() == 4
    summary = run.summary(["saturation_headway_s"])
    assert summary["lanes"]["a"]["saturation_headway_s"] == pytest.approx(measured[4:].mean())
    assert summary["lanes"]["b"]["saturation_headway_s"] is None
    assert 1.5 < summary["saturation_headway_s"] < 3.0, "HCM: about 1.9 s"


def test_one_that_never_stood_ends_the_queue() -> None:
    """Six stand, a seventh comes to the queue as it moves, and an eighth long after."""
    times = [0.0] * 6 + [100.0, 150.0]
    scenario = replayed(four_way(0, profile="fair"), *((t, 0, 2) for t in times), horizon=300.0)
    run = minisim.simulate(scenario, opened(0, at=90.0), record="all")
    assert np.isfinite(saturation_headways(run)).tolist() == [False] * 4 + [True] * 2 + [False] * 2


def test_a_queue_needs_the_whole_road() -> None:
    run = minisim.simulate(four_way(200, horizon=20.0), Dim(), record="junction")
    for of in (queue_lengths, saturation_headways):
        with pytest.raises(InputError, match="record='all'"):
            of(run)


def test_a_vehicle_that_moves_up_stays_in_the_queue() -> None:
    slow, fast = QUEUE_END - 0.01, QUEUE_END + 0.01
    one = [9.0, slow, 0.0, 0.2, slow, 0.0, slow, fast, slow, 0.1, fast]
    other = [slow, 0.05, slow]  # it is new, whatever the one before did
    first = [k in (0, len(one)) for k in range(len(one + other))]
    wanted = [0, 0, 1, 1, 1, 1, 1, 0, 0, 1, 0, 0, 1, 1]
    assert queueing(np.array(one + other), np.array(first)).astype(int).tolist() == wanted
    assert queueing(np.array([]), np.array([], dtype=bool)).tolist() == []


def test_states_hold_still_while_a_queue_creeps() -> None:
    """Vehicles move up one by one at a stop: few of these moves are fast enough to leave."""
    run = minisim.simulate(four_way(400, profile="fair", horizon=150), AllWayStop(), record="all")
    tracks = whole_tracks(run)
    coming = tracks.s < run.site.intersection.paths[0].entry
    stood, queued = tracks.v <= HALTING, queueing(tracks.v, tracks.first)
    assert queued[stood].all()
    often, seldom = (int(tracks.begins(state & coming).sum()) for state in (stood, queued))
    assert 0 < seldom < 0.9 * often
