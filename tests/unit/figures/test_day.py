"""The figure of a day."""

from __future__ import annotations

from baselines import AllWayStop
from dim import Dim
from figures import style
from figures.day import day_figure
from minisim import simulate
from minisim.demand import DemandProfile, Period
from minisim.results.service import service
from scenarios import three_way


def test_a_day_has_a_line_per_controller_at_the_middle_of_each_interval() -> None:
    day = DemandProfile(periods=(Period(start=25_200, end=27_000, rates=(200.0, 300.0, 100.0)),))
    junction = three_way(demand=day, profile="fair")
    runs = {it.name: simulate(junction, it) for it in (Dim(), AllWayStop())}
    runs["all-way-stop:x"] = runs["all-way-stop"]
    trips, waiting, delay = day_figure(runs).axes
    assert len(trips.lines) == 1
    assert [line.get_label() for line in waiting.lines] == ["DIM", "all-way stop", "all-way-stop:x"]
    looks = [(line.get_color(), line.get_linestyle()) for line in waiting.lines]
    assert looks[0] == (style.look("dim").colour, style.look("dim").dashes)
    assert looks[1][0] == looks[2][0]
    assert looks[1][1] != looks[2][1]
    assert [line.get_marker() for line in waiting.lines[1:]] == ["X", "$3$"]
    assert waiting.lines[1].get_xdata().tolist() == [7.125, 7.375]
    expected = service(runs["all-way-stop"])["control_delay_s"].tolist()
    assert delay.lines[1].get_ydata().tolist() == expected
