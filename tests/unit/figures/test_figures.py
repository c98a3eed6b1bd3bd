"""Figures and animations: everything is drawn where the model puts it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, product
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

import minisim
from baselines import FixedTime
from dim import Dim, HarmonyMatrix, explain
from figures import animation, crossval, decision, performance_figure, plots, style, write_animation
from figures.film.animate import Picture, frame_times
from figures.film.encode import COLOURS, palette_of, write_gif
from figures.film.frames import RELEASED, Frames
from figures.junction import drawing
from figures.studies import humans, perception
from figures.studies.shared import outcomes
from figures.whole import filmed, head_spans
from minisim.control import Plan, Unregulated
from minisim.errors import InputError
from minisim.fleet import TYPES
from minisim.junction.conflicts import corridor
from minisim.junction.geometry import Intersection
from minisim.results.queues import QUEUE_END
from minisim.results.run import Run
from minisim.vehicle import VehicleType
from scenarios import Scenario, five_way, four_way
from scenarios.controllers import VARIANTS
from scenarios.optimum import Clairvoyant
from scenarios.profiles import FAIR
from tests.builders import Fixed, replayed
from tests.colours import EYES, apart, rgb

INTERSECTIONS = [
    Intersection((0, 120, 240)),
    Intersection((0, 90, 180, 270), side="right"),
    Intersection((0, 72, 144, 216, 288), junction_radius=8.4),
    Intersection((0, 35, 100, 200)),
    Intersection((0, 60, 120)),
    Intersection((10, 100, 190), side="right", lane_width=4.0),
]


@pytest.fixture(scope="module")
def run() -> Run:
    recorded = {"record": "all", "record_window": (100, 130)}
    return minisim.simulate(four_way(400, horizon=130), Dim(), seed=4, **recorded)


@pytest.fixture(scope="module")
def picture(run: Run) -> Picture:
    return Picture(run, 100.0)


@pytest.fixture(scope="module")
def film(run: Run) -> Frames:
    return Frames(run, 100.0)


@pytest.fixture(scope="module")
def crash() -> Run:
    return minisim.simulate(
        four_way(350, horizon=150), Unregulated(), seed=1, record="all", on_collision="record"
    )


@pytest.mark.parametrize("intersection", INTERSECTIONS, ids=lambda i: str(i.bearings))
def test_bodies_stay_on_the_asphalt_and_lanes_lie_under_paths(intersection: Intersection) -> None:
    asphalt = shapely.Polygon(drawing.outline(intersection, 100.0))
    assert asphalt.is_valid
    vehicle = VehicleType()
    for path in intersection.paths:
        # A long body cuts the tightest corners by a few centimetres.
        assert asphalt.buffer(0.2).covers(corridor(path, vehicle))
        corners = drawing.lane_strip(intersection, path.movement.origin, 38.0, 8.0)
        strip = shapely.Polygon(corners)
        way = shapely.LineString(path.position([path.entry - 38.0, path.entry - 8.0]))
        assert strip.area == pytest.approx(30.0 * intersection.lane_width)
        assert way.hausdorff_distance(strip.centroid) == pytest.approx(15.0)
        wide = way.buffer(0.4 * intersection.lane_width, cap_style="flat")
        assert strip.buffer(1e-6).covers(wide)


def test_hold_lines_cross_the_paths_at_the_hold_distance() -> None:
    intersection = Intersection((0, 90, 180, 270))
    lines = drawing.hold_lines(intersection, Plan(hold_distance=2.0))
    for path in intersection.paths:
        front = path.position(path.entry - 2.0)
        np.testing.assert_allclose(lines[path.movement.origin].mean(axis=0), front, atol=1e-9)


def test_bodies_are_drawn_where_the_model_has_them(run: Run) -> None:
    vehicle = run.site.vehicle
    path = run.site.intersection.paths[2]
    for s in (path.entry - 3.0, path.entry + 4.0, path.exit + 9.0):
        centre, heading = path.pose(s, vehicle)
        front = centre + heading * vehicle.length / 2.0
        angle = math.degrees(math.atan2(heading[0], heading[1]))
        body, glass = drawing.body_shape(vehicle)
        drawn = shapely.Polygon(drawing.place(body, *front, angle)[0])
        true = shapely.Polygon(path.bodies(s, vehicle))
        assert true.buffer(1e-6).covers(drawn), "a rounded body inside the model's rectangle"
        assert drawn.area > 0.93 * true.area
        assert drawn.covers(shapely.Polygon(drawing.place(glass, *front, angle)[0]))


def test_film_counts_what_the_trajectories_say(run: Run, film: Frames) -> None:
    frame = run.trajectories
    for time in (100.1, 112.0, 129.9):
        now = frame[np.isclose(frame["time_s"], time)]
        assert film.at(time).stop - film.at(time).start == len(now)
        still, slow = ((now["speed_mps"] <= limit).sum() for limit in (0.1, QUEUE_END))
        assert still <= film.waiting(film.rows(film.at(time), 1e9)) <= slow
    assert film.served(100.0) == 0
    paths = run.site.intersection.paths
    cleared = 0
    for _, trip in frame.groupby("vehicle"):
        index = "abcd".index(trip["lane"].iloc[0]) * 3 + trip["manoeuvre"].iloc[0] - 1
        clear = paths[index].exit + run.site.vehicle.length
        cleared += (trip["s_m"].iloc[0] <= clear) and (trip["s_m"].iloc[-1] > clear)
    assert film.served(130.0) == cleared > 0


def test_lanes_open_with_their_first_vehicle(film: Frames) -> None:
    opened = set()
    for time in frame_times(100.1, 29.0, 10.0, 0.1).tolist():
        rows = film.rows(film.at(time), 1e9)
        for lane in film.open_lanes(rows):
            ahead = rows[(film.lane[rows] == lane) & (film.s[rows] <= film.entry)]
            assert film.state[ahead[np.argmax(film.s[ahead])]] == RELEASED
            opened.add(lane)
    assert opened


def test_a_film_shows_what_the_heads_show_at_all_times(tmp_path: Path) -> None:
    """Also where no vehicle comes, and amber: the run was not asked for its heads."""
    run = minisim.simulate(four_way(100, horizon=120), FixedTime(), seed=2, record="all")
    film, spans, seen = Frames(run, 0.0), head_spans(run), set()
    picture = Picture(run)
    for time in frame_times(0.0, 119.0, 2.0, 0.1).tolist():
        shown = film.heads(time)
        for span in spans:
            if span.start <= time < span.end:
                assert shown[span.lane] == span.state
        seen |= set(shown.values())
        if time % 10 < 0.1:
            picture.draw(time)
            drawn = {state: len(marks.get_xdata()) for state, marks in picture._heads.items()}
            assert drawn == {state: [*shown.values()].count(state) for state in style.HEADS}
    assert seen == set(style.HEADS)
    words = {text.get_text() for text in picture._figure.texts}
    assert words >= {"green", "amber", "red", "band: its way"}


@pytest.mark.parametrize("make", [four_way, five_way])
def test_arrows_on_roofs_point_where_vehicles_leave(make: Callable[..., Scenario]) -> None:
    run = minisim.simulate(make(300, horizon=60), Dim(), seed=1, record="all")
    film, arms = Frames(run, 0.0), run.site.intersection.arms
    rows = film.rows(film.at(film.busiest), 1e9)
    rows = rows[film.s[rows] <= film.exit[film.path[rows]]]
    arrows, manoeuvres = film.arrows(rows), set()
    for arrow, path in zip(arrows, film.path[rows].tolist(), strict=True):
        way = run.site.intersection.paths[path]
        forward = arrow[0] - arrow[3:5].mean(axis=0)
        np.testing.assert_allclose(
            forward / np.linalg.norm(forward), arms[way.exit_arm].outward, atol=1e-9
        )
        manoeuvres.add(way.movement.manoeuvre)
    assert manoeuvres == set(range(1, len(arms)))


def test_ways_end_at_the_exit(run: Run, film: Frames) -> None:
    exits = np.array([path.position(path.exit) for path in run.site.intersection.paths])
    ways = [way for t in range(101, 130) for way in film.ways(film.rows(film.at(t), 1e9))]
    assert ways
    for way in ways:
        assert np.min(np.linalg.norm(exits - way[-1], axis=1)) < 1e-6


def test_collisions_are_ringed(crash: Run) -> None:
    film, first = Frames(crash, 0.0), crash.collisions[0]
    assert film.collided(first.time - 0.1) == 0
    assert film.crashes(first.time - 0.1) == []
    (ring,) = film.crashes(first.time)
    assert film.collided(first.time) == 1
    harmed = {v for collision in crash.collisions for v in collision.vehicles}
    clear = film.s > film.exit[film.path] + crash.site.vehicle.length
    unharmed = set(crash.trajectories["vehicle"][clear]) - harmed
    assert film.served(150.0) == len(unharmed), "what collided was not served"
    junction = crash.site.intersection
    front = junction.path(junction.parse(first.movements[0])).position(first.positions[0])
    assert np.linalg.norm(ring.mean(axis=0) - front) < 6.0


def test_what_collided_stays_crossed_out_while_it_drives_on(crash: Run) -> None:
    film, first = Frames(crash, 0.0), crash.collisions[0]
    vehicle = crash.trajectories["vehicle"].to_numpy()
    for time, harmed in ((-0.1, 0), (0.0, 2), (5.0, 2)):
        rows = film.rows(film.at(first.time + time), 1e9)
        rows = rows[np.isin(vehicle[rows], first.vehicles)]
        strokes = film.crossed_out(rows, first.time + time)
        assert len(strokes) == 2 * harmed
        fronts = np.c_[film.x, film.y][rows].tolist()
        for stroke in strokes:  # its middle is that of a body
            away = np.linalg.norm(np.array(fronts) - stroke.mean(axis=0), axis=1)
            assert away.min() == pytest.approx(crash.site.vehicle.length / 2.0)


def test_a_long_title_ends_before_the_clock(crash: Run) -> None:
    picture = Picture(replace(crash, controller=Fixed(name="long" * 20)))
    title, clock = (picture._figure.texts[0], picture._clock)
    clock.set_text("00:00")
    assert title.get_window_extent().x1 < clock.get_window_extent().x0


def test_nothing_recorded_is_an_error() -> None:
    empty = minisim.simulate(four_way(0, horizon=5), Dim(), record="all")
    with pytest.raises(InputError, match="no vehicle"):
        Picture(empty)
    with pytest.raises(InputError, match="record"):
        Picture(minisim.simulate(four_way(300, horizon=5), Dim()))


def pixels(image: Image.Image) -> npt.NDArray[np.int64]:
    return np.asarray(image).astype(np.int64)


def test_picture_is_the_same_whatever_was_drawn_before(run: Run, picture: Picture) -> None:
    before = pixels(picture.draw(105.0))
    picture.draw(128.3)
    assert (pixels(picture.draw(105.0)) == before).all()
    assert (pixels(Picture(run, 100.0).draw(105.0)) == before).all()


def test_picture_shows_the_vehicles(run: Run, picture: Picture) -> None:
    """A vehicle that waits or is about to cross has its colour at its place."""
    frame, entry = run.trajectories, run.site.intersection.paths[0].entry
    near = frame[(frame["s_m"] > entry - 25.0) & (frame["s_m"] < entry + 5.0)]
    seen = set()
    for time in np.arange(101.0, 130.0).tolist():
        image = pixels(picture.draw(time))
        for row in near[(near["time_s"] - time).abs() < 0.01].itertuples():
            if not row.right_of_way and row.speed_mps > 0.1:
                continue
            heading = np.radians(row.angle_deg)
            hood = (row.x_m - 0.8 * np.sin(heading), row.y_m - 0.8 * np.cos(heading))
            x, y = picture._axes.transData.transform(hood)
            colour = image[image.shape[0] - 1 - round(y), round(x)]
            wanted = style.RIGHT_OF_WAY if row.right_of_way else style.WAITING
            assert np.abs(colour - rgb(wanted)).max() < 12
            seen.add(wanted)
    assert seen == {style.RIGHT_OF_WAY, style.WAITING}


def test_any_two_controllers_are_told_apart() -> None:
    """By marker, and either by colour, to all eyes, or by dashes."""
    assert Clairvoyant.name in style.SERIES
    looks = [style.look(name) for name in (*VARIANTS, Clairvoyant.name, "of one's own")]
    for one, other in combinations(looks, 2):
        assert one.marker != other.marker
        if one.dashes == other.dashes:
            assert min(apart(one.colour, other.colour, eyes) for eyes in EYES) >= 20.0, (one, other)


def test_any_two_series_of_a_figure_are_told_apart() -> None:
    """Those that are no controllers: by colour, to all eyes, or by marker and dashes."""
    kinds = (style.ARMS, perception.LOOKS, outcomes.KIND_LOOKS, humans.LOOKS)
    sources = (crossval.MINISIM, crossval.SUMO, crossval.PUBLISHED)
    for looks in (*(tuple(it.values()) for it in kinds), sources):
        for one, other in combinations(map(style.coloured, looks), 2):
            if one.marker == other.marker or one.dashes == other.dashes:
                near = min(apart(one.colour, other.colour, eyes) for eyes in EYES)
                assert near >= 20.0, (one, other)


def test_every_zone_is_coloured(picture: Picture) -> None:
    seen = {tuple(c) for c in pixels(picture.draw(129.0)).reshape(-1, 3).tolist()}
    assert {tuple(rgb(colour)) for colour in style.ZONES.values()} <= seen


@pytest.mark.parametrize("eyes", EYES)
def test_zones_are_told_apart_without_red_and_green(eyes: str) -> None:
    zones = list(style.ZONES.values())
    pairs = [*combinations(zones, 2)]
    beside = [*product(zones, (style.ASPHALT, style.BLUE))]
    for least, close in ((20.0, pairs), (15.0, beside)):
        for one, other in close:
            assert apart(one, other, eyes) >= least


def test_the_legend_names_zones_by_their_place_and_fits(picture: Picture) -> None:
    picture.draw(129.0)
    texts = picture._figure.texts
    assert {"red 38–8 m: slow", "green 2–0 m: buffer"} <= {text.get_text() for text in texts}
    assert max(text.get_window_extent().x1 for text in texts) < picture._figure.bbox.x1


def test_frame_times_are_steps() -> None:
    times = frame_times(10.0, 2.0, 4.0, 0.1)
    np.testing.assert_allclose(times, [10.0, 10.2, 10.5, 10.8, 11.0, 11.2, 11.5, 11.8])
    for bad in ((-1.0, 2.0, 4.0), (0.0, 0.0, 4.0), (0.0, 2.0, 11.0), (0.0, math.inf, 4.0)):
        with pytest.raises(InputError):
            frame_times(*bad, 0.1)


images = st.lists(
    st.binary(min_size=48, max_size=48).map(
        lambda data: Image.frombytes("RGB", (4, 4), bytes(b & 0xC0 for b in data))
    ),
    min_size=1,
    max_size=6,
)


def palette_for(frames: list[Image.Image]) -> Image.Image:
    """A palette of all pictures at once: four levels per channel, few enough to change none."""
    strip = Image.new("RGB", (4, 4 * len(frames)))
    for k, frame in enumerate(frames):
        strip.paste(frame, (0, 4 * k))
    return palette_of(strip).crop((0, 0, 4, 4))


def indexed(frames: list[Image.Image], palette: Image.Image) -> list[Image.Image]:
    return [f.quantize(palette=palette, dither=Image.Dither.NONE).convert("RGB") for f in frames]


@given(images)
def test_gif_plays_back_every_frame(tmp_path_factory: pytest.TempPathFactory, frames: list) -> None:
    frames = [*frames, frames[-1]]  # one that repeats
    palette = palette_for(frames)
    file = tmp_path_factory.mktemp("gif") / "film.gif"
    write_gif(iter(frames), palette, file, fps=10.0)
    with Image.open(file) as film:
        assert film.n_frames == len(frames)
        assert film.info["loop"] == 0
        for k, frame in enumerate(indexed(frames, palette)):
            film.seek(k)
            assert film.info["duration"] == 100
            assert (pixels(film.convert("RGB")) == pixels(frame)).all()


@pytest.mark.parametrize("fps", [0.3, 7.0, 10.0, 24.0, 30.0, 50.0])
def test_gif_plays_as_fast_as_asked(tmp_path: Path, fps: float) -> None:
    """No frame is shown a hundredth of a second early or late, though delays are whole ones."""
    frames = [Image.new("RGB", (4, 4), (k % 2 * 192, 0, 0)) for k in range(60)]
    file = tmp_path / "film.gif"
    write_gif(iter(frames), palette_for(frames), file, fps)
    delays = []
    with Image.open(file) as film:
        for k in range(film.n_frames):
            film.seek(k)
            delays.append(film.info["duration"])
    assert min(delays) >= 20, "viewers take less for 100 ms"
    ends = np.cumsum(delays)
    np.testing.assert_allclose(ends, 1000.0 * np.arange(1, 61) / fps, atol=5.0 + 1e-6)


def test_a_gif_of_more_than_50_frames_per_second_keeps_its_length(tmp_path: Path) -> None:
    profile = replace(FAIR, dt=0.01)
    run = minisim.simulate(four_way(400, profile=profile, horizon=42.0), Dim(), record="all")
    file = tmp_path / "film.gif"
    write_animation(run, file, start=41.0, seconds=0.5, fps=100.0)
    with Image.open(file) as film:
        assert film.n_frames == 25
        assert film.info["duration"] == 20


@pytest.mark.parametrize(("start", "seconds"), [(200.0, 2.0), (90.0, 60.0), (120.0, 20.0)])
def test_no_film_after_the_end(run: Run, tmp_path: Path, start: float, seconds: float) -> None:
    with pytest.raises(InputError, match="but the run ended at 130 s"):
        write_animation(run, tmp_path / "film.gif", start=start, seconds=seconds)
    assert not list(tmp_path.iterdir())


def test_what_was_not_recorded_is_run_again(run: Run) -> None:
    again = filmed(run, 90.0, 95.0)
    assert again is not run
    assert filmed(run, 100.0, 130.0) is run
    np.testing.assert_array_equal(again.columns.arrival, run.columns.arrival)
    pictures = [Picture(it, 100.0).draw(110.0) for it in (run, again)]
    assert (pixels(pictures[0]) == pixels(pictures[1])).all()


def test_an_animation_saves_and_shows_itself(run: Run, tmp_path: Path) -> None:
    film = animation(run, start=110.0, seconds=0.3)
    assert film._repr_html_().count("data:image/png") == 3
    film.save(tmp_path / "film.gif", writer="pillow")
    with Image.open(tmp_path / "film.gif") as saved:
        assert saved.n_frames == 3
        drawn, wanted = pixels(saved.convert("RGB")), pixels(Picture(run, 110.0).draw(110.0))
    assert np.abs(drawn - wanted).mean() < 3.0, "the same picture, but for GIF's colours"


def test_the_header_tells_recorded_arrivals_from_a_demand(run: Run) -> None:
    def written(shown: Run) -> str:
        return " ".join(text.get_text() for text in Picture(shown)._figure.texts)

    two = replayed(four_way(33), (0.0, 0, 2), (0.0, 2, 2), horizon=30.0)
    recorded = written(minisim.simulate(two, Dim(), record="all"))
    assert "2 recorded arrivals" in recorded
    assert "veh/h" not in recorded
    assert "400 veh/h/lane" in written(run)


def test_palette_leaves_an_index_free() -> None:
    gradient = np.arange(256 * 256 * 3, dtype=np.uint32).astype(np.uint8).reshape(256, 256, 3)
    assert np.asarray(palette_of(Image.fromarray(gradient))).max() < COLOURS


def test_animation_is_written_whole_or_not(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "film.gif"
    file.write_bytes(b"before")

    def stop(done: int, total: int) -> None:
        assert total == 20
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_animation(run, file, start=110, seconds=2, progress=stop)
    assert list(tmp_path.iterdir()) == [file]
    assert file.read_bytes() == b"before"
    write_animation(run, file, start=110, seconds=2)
    first = file.read_bytes()
    write_animation(run, file, start=110, seconds=2)
    assert file.read_bytes() == first


@pytest.mark.parametrize("body", [None, TYPES["bus-offtracking"]])
def test_decision_figure_names_every_vehicle_and_its_texts_do_not_overlap(
    body: VehicleType | None,
) -> None:
    site = four_way().site()
    matrix = HarmonyMatrix.from_geometry(site.intersection, site.vehicle)
    explanation = explain(["a1", "b2", "c2", "d2"], matrix)
    figure = decision(explanation, site, Dim().start(site).plan, body)
    scene, graph = figure.axes
    assert {t.get_text() for t in scene.texts} >= {"a1", "b2", "c2", "d2", "a", "b", "c", "d"}
    assert {t.get_text() for t in graph.texts} >= {"a1", "b2", "c2", "d2"}
    strong = [line for line in graph.lines if line.get_color() == style.RIGHT_OF_WAY]
    assert (len(graph.lines), len(strong)) == (len(explanation.edges), 1)
    assert any(t.get_text() == "Right of way: a1, b2" for t in figure.texts)
    (zones,) = figure.legends
    words = ["red 38–8 m", "yellow 8–2 m", "green 2–0 m"]
    assert [t.get_text() for t in zones.get_texts()] == words
    # c2 and d2 cross at (-w/2, w/2), b2 and c2 at (-w/2, -w/2) for lanes w wide; a1 joins d2.
    half = site.intersection.lane_width / 2.0
    (marks,) = [line for line in scene.lines if line.get_marker() == "x"]
    crossed = {tuple(point) for point in np.round(marks.get_xydata(), 6)}
    assert len(crossed) == 3
    assert crossed >= {(-half, half), (-half, -half)}
    figure.draw_without_rendering()
    boxes = [t.get_window_extent() for t in (*scene.texts, *graph.texts, *figure.texts)]
    assert all(box.x0 >= 0 and box.x1 <= figure.bbox.x1 for box in boxes)
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


def test_performance_figure_draws_means_and_intervals() -> None:
    points = pd.DataFrame({
        "controller": ["dim", "fixed-time"] * 2, "density": [150.0, 150.0, 350.0, 350.0],
        "waiting_time_s": [1.0, 9.0, 20.0, 90.0], "waiting_time_s_ci95": [0.1, 1.0, 5.0, 9.0],
        "travel_time_s": [80.0, 90.0, 100.0, 180.0], "travel_time_s_ci95": [1.0, 2.0, 3.0, 4.0],
    })  # fmt: skip
    waiting, travel = performance_figure(points, "title").axes
    for axes, column in ((waiting, "waiting_time_s"), (travel, "travel_time_s")):
        assert axes.get_title(loc="left") == f"{column.split('_')[0].capitalize()} time"
        handles, labels = axes.get_legend_handles_labels()
        assert labels == ["DIM", "fixed-time signal"]
        for handle, controller in zip(handles, ("dim", "fixed-time"), strict=True):
            line, caps, _ = handle.lines
            chosen = points[points["controller"] == controller]
            upper = chosen[column] + chosen[f"{column}_ci95"]
            np.testing.assert_allclose(np.array(line.get_ydata(), float), chosen[column])
            np.testing.assert_allclose(np.array(caps[1].get_ydata(), float), upper)


def test_a_corridor_is_drawn_where_the_bodies_go() -> None:
    path, it = four_way().intersection.paths[2], TYPES["bus-offtracking"]
    axes = style.new_figure(3.0, 3.0).add_axes((0, 0, 1, 1))
    drawing.draw_corridor(axes, path, it, style.BLUE)
    shades = [shapely.Polygon(patch.get_xy()).buffer(1e-6) for patch in axes.patches]
    bodies = shapely.polygons(path.bodies(np.linspace(path.entry, path.exit + it.length, 30), it))
    for shade in shades:
        assert shapely.covers(shade.buffer(0.02), bodies).all()
        assert shade.area < 1.05 * shapely.union_all(bodies).area
    assert len(shades) == 2, "its shade and its outline"


@pytest.mark.parametrize("densities", [(150, 350), (50, 100, 200, 800), (100,)])
def test_series_stay_within_the_axes_side_by_side(densities: tuple[int, ...]) -> None:
    rows = pd.DataFrame({"density": densities})
    shifts = [plots.offset(rows, place, 5) for place in range(5)]
    assert shifts == sorted(shifts)
    axes = plots.panels(6.0, 4.5, 1)[1][0]
    plots.density_axis(axes, densities)
    low, high = axes.get_xlim()
    room = min(min(densities) - low, high - max(densities))
    assert max(map(abs, shifts)) < 0.5 * room
