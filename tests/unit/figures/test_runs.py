"""Textbook pictures of one run show what the run did."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex

import minisim
from baselines import FixedTime
from dim import Dim
from figures import cumulative, queues, style, time_space
from figures.runs import STROKES, cumulative_times
from figures.whole import head_spans, heads, whole
from minisim.errors import InputError
from minisim.results.queues import queue_lengths
from minisim.results.run import Run
from scenarios import four_way
from tests.builders import drained
from tests.colours import EYES, apart


@pytest.fixture(scope="module")
def signal() -> Run:
    return minisim.simulate(four_way(300, horizon=120), FixedTime(), seed=2)


@pytest.fixture(scope="module")
def run() -> Run:
    return minisim.simulate(four_way(400, horizon=150), Dim(), seed=4, record="all")


def area(run: Run) -> tuple[float, str]:
    """Between the curves as drawn, and the title."""
    (axes,) = cumulative(run).axes
    arrivals, departures = (np.asarray(line.get_xydata()) for line in axes.lines)
    drawn = np.diff(arrivals[:, 0]) @ (arrivals[:-1, 1] - departures[:-1, 1])
    assert departures[-1, 1] == run.counted.columns.arrived.sum()
    return float(drawn), axes.get_title(loc="left")


def test_the_area_between_the_curves_is_the_control_delay() -> None:
    scenario = drained(four_way(450, horizon=60), seed=1, horizon=400)
    run = minisim.simulate(scenario, FixedTime(), seed=1)
    drawn, title = area(run)
    mean = run.summary(["control_delay_s"])["control_delay_s"]
    assert drawn == pytest.approx(mean * len(run.trips))
    assert f"{mean:.1f} s per vehicle" in title


@pytest.mark.parametrize("warmup", [0.0, 40.0])
def test_the_area_holds_the_delay_of_trips_that_have_not_ended(warmup: float) -> None:
    run = minisim.simulate(four_way(450, horizon=150, warmup=warmup), FixedTime(), seed=1)
    trips = run.counted.columns
    assert not trips.arrived.all()
    assert area(run)[0] == pytest.approx((trips.time_loss + trips.depart_delay).sum())


def test_nothing_arrives_after_it_departs(run: Run) -> None:
    arrivals, departures = cumulative_times(run)
    done = run.counted.columns.arrived
    assert (arrivals[done] <= departures + 1e-9).all()


def test_queues_are_those_of_the_metric(run: Run) -> None:
    (axes,) = queues(run).axes
    lengths = queue_lengths(run)
    assert lengths.max() > 1
    drawn = np.stack([line.get_ydata() for line in axes.lines], axis=1)
    np.testing.assert_array_equal(drawn, lengths)
    assert "slower than 5 km/h for 1 s" in axes.get_xlabel()


def test_a_time_space_diagram_shows_every_vehicle_of_the_lane(run: Run) -> None:
    (axes,) = time_space(run, "b", start=50.0, end=100.0).axes
    segments = [s for c in axes.collections if isinstance(c, LineCollection)
                for s in c.get_segments()]  # fmt: skip
    frame = run.trajectories
    mine = frame[(frame["lane"] == "b") & frame["time_s"].between(50.0, 100.0)]
    entry = run.site.intersection.paths[0].entry
    steps = len(mine) - mine["vehicle"].nunique()
    assert len(segments) == steps
    blue = sum(len(c.get_segments()) for c in axes.collections
               if to_hex(c.get_color()[0]).upper() == style.RIGHT_OF_WAY)  # fmt: skip
    assert 0 < blue <= mine["right_of_way"].sum()
    wanted = {(round(t, 3), round(s - entry, 3)) for t, s in mine[["time_s", "s_m"]].to_numpy()}
    assert {tuple(np.round(p, 3)) for s in segments for p in s} <= wanted


def test_heads_are_shown_at_all_times_though_nothing_was_recorded(signal: Run) -> None:
    assert signal.record is None
    assert signal.heads is None
    spans = head_spans(signal)
    assert {span.state for span in spans} == set(style.HEADS)
    for lane in range(4):
        mine = [span for span in spans if span.lane == lane]
        assert mine[-1].end == 120.0
        assert all(one.end == other.start for one, other in pairwise(mine))
        assert all(one.state != other.state for one, other in pairwise(mine))
    (axes,) = time_space(signal, "a", end=60.0).axes
    words = {text.get_text() for text in axes.get_legend().get_texts()}
    assert words >= set(style.HEADS)


def test_what_was_recorded_is_not_run_again(run: Run, signal: Run) -> None:
    assert whole(run) is run
    assert whole(signal) is whole(signal) is not signal
    assert heads(run) == ()


def test_figures_go_into_given_axes_and_show_themselves(run: Run) -> None:
    figure = style.new_figure(8.0, 8.0, dpi=50)
    for ax, draw in zip(figure.subplots(3), (queues, cumulative, time_space), strict=True):
        assert draw(run, ax=ax) is figure
        assert ax.has_data()
        assert draw(run)._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("more", "said"),
    [({"lane": "e"}, "lane"), ({"end": -1.0}, "end"), ({"start": 200.0}, "end"),
     ({"start": -1.0}, "start")],
)  # fmt: skip
def test_a_lane_or_time_that_the_run_does_not_have(run: Run, more: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        time_space(run, **more)


@pytest.mark.parametrize("eyes", EYES)
def test_lanes_and_heads_are_told_apart_by_colour_or_shape(eyes: str) -> None:
    for (one, dashes), (other, others) in combinations(STROKES, 2):
        assert dashes != others or apart(one, other, eyes) >= 20.0
    for one, other in combinations(style.HEADS.values(), 2):
        assert one.marker != other.marker
        assert max(one.width, other.width) >= 1.5 * min(one.width, other.width)
