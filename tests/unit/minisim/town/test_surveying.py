"""What the simulator makes of nodes whose geometry is known."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from minisim.errors import InputError
from minisim.town import Survey, read_junction, survey, survey_of
from tests.builders import town_text

SQUARE = {"n": (0.0, 200.0), "e": (200.0, 0.0), "s": (0.0, -200.0), "w": (-200.0, 0.0)}


def written(folder: Path, *arguments: Any, **options: Any) -> Path:
    path = folder / "town.net.xml"
    path.write_text(town_text(*arguments, **options))
    return path


def surveyed(path: Path) -> Survey:
    return next(it for it in survey(path) if it.node.id == "C")


@pytest.mark.parametrize("left", [False, True])
def test_a_crossing_is_read_as_it_is(tmp_path: Path, left: bool) -> None:
    made = read_junction(written(tmp_path, SQUARE, left=left))
    assert made.bearings == (0.0, 90.0, 180.0, 270.0)
    assert made.side == ("left" if left else "right")
    assert made.junction_radius == pytest.approx(7.2)
    assert made.forbidden == ()
    assert made.roads is not None
    for road in made.roads:
        assert road.length == pytest.approx(200.0)
        assert road.speed_limit == 13.89
        assert (road.lane_width, road.traffic) == (3.2, "both")


def test_bearings_are_clockwise_from_north(tmp_path: Path) -> None:
    def place(degrees: float) -> tuple[float, float]:
        angle = math.radians(degrees)
        return 150.0 * math.sin(angle), 150.0 * math.cos(angle)

    angles = {"p": 250.0, "q": 12.5, "r": 130.0}
    made = read_junction(written(tmp_path, {name: place(at) for name, at in angles.items()}))
    assert made.bearings == pytest.approx((12.5, 130.0, 250.0), abs=0.01)


def test_one_way_roads_and_missing_connections_are_kept(tmp_path: Path) -> None:
    path = written(tmp_path, SQUARE, one_way=["eC", "Cw"], missing=[("nC", "Cs"), ("nC", "Cn")])
    made = read_junction(path, "C")
    assert [road.traffic for road in made.roads or ()] == ["both", "in", "both", "out"]
    assert made.forbidden == ("a2",)
    allowed = [str(m) for m, may in zip(made.movements, made.allowed, strict=True) if may]
    assert allowed == ["a3", "b1", "b2", "b3", "c1", "c2"]
    found = surveyed(path)
    assert found.misfit == pytest.approx(0.0, abs=0.01)
    assert "turning back on c is left out" in found.verdict


def test_a_road_that_misses_the_centre_is_told(tmp_path: Path) -> None:
    """The axes of n and s are 4 m apart: the centre is between them, and each lane off by 2 m."""
    text = town_text(SQUARE)
    for line in [line for line in text.splitlines() if 'id="nC_0"' in line or 'id="Cn_0"' in line]:
        moved = line
        for point in ("-1.600,", "1.600,"):
            moved = moved.replace(f'"{point}', f'"{float(point[:-1]) + 4.0:.3f},')
            moved = moved.replace(f" {point}", f" {float(point[:-1]) + 4.0:.3f},")
        text = text.replace(line, moved)
    path = tmp_path / "town.net.xml"
    path.write_text(text)
    found = surveyed(path)
    assert found.intersection is not None
    assert 1.0 < found.misfit < 3.0
    assert f"lanes at most {found.misfit:.1f} m from the network's" in found.verdict


def test_two_one_way_edges_at_nearly_one_angle_are_one_road(tmp_path: Path) -> None:
    places = {**SQUARE, "x": (40.0, 196.0), "n": (-40.0, 196.0)}
    found = surveyed(written(tmp_path, places, one_way=["nC", "Cx"]))
    assert [arm.traffic for arm in found.arms] == ["both"] * 4
    assert "nC and Cx are taken as one road, a" in found.verdict


def test_roads_go_on_through_bends_to_the_next_junction(tmp_path: Path) -> None:
    beyond = (
        '<edge id="on" from="far" to="n"><lane id="on_0" speed="13.89" length="120" '
        'shape="0,320 0,200"/></edge><junction id="far" type="priority" x="0" y="320"/>'
    )
    made = read_junction(written(tmp_path, SQUARE, extra=beyond), "C")
    assert made.roads is not None
    assert made.roads[0].length == pytest.approx(320.0)
    assert made.roads[1].length == pytest.approx(200.0)


def test_short_roads_are_lengthened_and_that_is_told(tmp_path: Path) -> None:
    found = surveyed(written(tmp_path, {**SQUARE, "e": (30.0, 0.0)}))
    assert "roads lengthened to 60 m: b (23 m)" in found.verdict
    assert found.intersection is not None
    assert found.intersection.shortest_approach == pytest.approx(60.0)


@pytest.mark.parametrize(
    ("places", "options", "message"),
    [
        ({"n": (0.0, 99.0), "s": (0.0, -99.0)}, {}, "2 arms for cars; 3 are needed"),
        (SQUARE, {"lanes": {"nC": ["", ""]}}, "several lanes for cars on an edge: nC has 2"),
        ({**SQUARE, "x": (40.0, 196.0)}, {}, "arms a and b are 11.5"),
    ],
)
def test_what_the_simulator_cannot_say_is_named(
    tmp_path: Path, places: dict[str, Any], options: dict[str, Any], message: str
) -> None:
    path = written(tmp_path, places, **options)
    assert message in surveyed(path).verdict
    with pytest.raises(InputError, match=f"node C of .* cannot be read: .*{message}"):
        read_junction(path, "C")


def test_a_node_is_found_or_near_ones_are_named(tmp_path: Path) -> None:
    path = written(tmp_path, {**SQUARE, "n": (0.0, 200.0)})
    assert survey_of(path).node.id == "C"  # the only one that can be read
    with pytest.raises(InputError, match=r"no node 'c' among the 5 of .*; did you mean|names them"):
        read_junction(path, "c")
    with pytest.raises(InputError, match="side is for an extract"):
        read_junction(path, "C", side="left")
    path.write_text(town_text({"n": (0.0, 99.0), "s": (0.0, -99.0)}))
    with pytest.raises(InputError, match="none of its 3 nodes can be read"):
        read_junction(path)
