"""The player in a real browser: each feature is used and looked at, in several windows."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

import minisim
from baselines import FixedTime
from dim import Dim
from figures import Player, play
from figures.player.page import HEIGHTS, script
from figures.player.scene import dumped, scene
from minisim.control import Unregulated
from minisim.results.run import Run
from scenarios import four_way
from tests.browser.chromium import Browser, Page, browser_path, chromium
from tests.builders import replayed

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(browser_path() is None, reason="needs chromium or chrome"),
]

WINDOWS = [(390, 844), (1280, 720), (1920, 950)]
START, SECONDS = 60.0, 30.0
#: The player of a page, and a part of it.
PLAYER = "document.querySelector('minisim-player')"
PART = "document.querySelector('minisim-player').shadowRoot.querySelector"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with chromium(tmp_path_factory.mktemp("chromium")) as running:
        yield running


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    what = four_way(350, horizon=100.0)
    return [
        minisim.simulate(what, it, seed=1, record="all", explain=True)
        for it in (Dim(), FixedTime())
    ]


@pytest.fixture(scope="module")
def files(runs: list[Run], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    one, two = (scene(it, start=START, seconds=SECONDS) for it in runs)
    named = {"one": (one,), "two": (one, two), "signal": (two,)}
    for name, scenes in named.items():
        Player(*scenes).save(folder / f"{name}.html")
    return {name: folder / f"{name}.html" for name in named}


def opened(browser: Browser, file: Path, window: tuple[int, int], *, calm: bool = True) -> Page:
    shown = browser.page(calm=calm)
    shown.size(*window)
    shown.open(file.as_uri())
    shown.until(f"{PLAYER}.panes && {PLAYER}.panes.length")
    return shown


def at_rest(shown: Page, file: Path) -> None:
    """Nothing complained, and nothing but the page was asked for."""
    assert shown.errors == []
    assert set(shown.requests) == {file.as_uri()}


def where(shown: Page, vehicle: int, pane: int = 0) -> tuple[float, float]:
    """Where in the window the middle of a vehicle is [px]."""
    return tuple(
        shown.run(f"""(() => {{
      const pane = {PLAYER}.panes[{pane}], box = pane.canvas.getBoundingClientRect();
      const car = pane.cars.find((it) => it.track.id === {vehicle}), half = car.type.length / 2;
      const k = box.width / (2 * {PLAYER}.reach);
      return [box.left + box.width / 2 + k * (car.x - half * car.ux),
              box.top + box.height / 2 - k * (car.y - half * car.uy)];
    }})()""")
    )


def go_to_a_wait(shown: Page, kind: str) -> tuple[int, Any]:
    """Go to the first moment at which a vehicle in the picture has a reason of this kind."""
    found = shown.run(f"""(() => {{
      const player = {PLAYER}, scene = player.panes[0].scene;
      for (let step = 0; step < scene.data.steps; step++)
        for (const car of scene.at(step)) {{
          if (Math.max(Math.abs(car.x), Math.abs(car.y)) > player.reach - 6) continue;
          const why = scene.why(car.track.id, step);
          if (why.length === 1 && why[0].kind === "{kind}" && why[0].others.every((id) =>
              scene.at(step).some((it) => it.track.id === id))) {{
            player.time = scene.data.start + step * scene.data.step;
            return [car.track.id, why[0]];
          }}
        }}
    }})()""")
    assert found, f"no vehicle waits because of {kind!r}"
    return found[0], found[1]


def test_a_click_says_why(browser: Browser, files: dict[str, Path], runs: list[Run]) -> None:
    """The short one: it opens quickly, and a click on a vehicle says why it waits."""
    shown = opened(browser, files["one"], (1280, 720))
    vehicle, why = go_to_a_wait(shown, "other clique")
    shown.click(*where(shown, vehicle))
    assert shown.run(f"{PLAYER}.chosen") == vehicle
    sentence = runs[0].why(vehicle, shown.run(f"{PLAYER}.time")).sentence
    assert shown.run(f"{PART}('.why').textContent") == sentence == why["sentence"]
    at_rest(shown, files["one"])


@pytest.mark.slow
@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("name", ["one", "two", "signal"])
def test_everything_in_every_window(
    browser: Browser, files: dict[str, Path], name: str, window: tuple[int, int]
) -> None:
    shown = opened(browser, files[name], window)
    assert shown.busy() < 0.5, "seconds to open"
    width, height = window
    assert shown.run("document.documentElement.scrollWidth") <= width
    assert shown.run("document.documentElement.scrollHeight") <= height
    for part in (".play", ".back", ".on", ".time", ".speed", "canvas.junction"):
        box = shown.run(f"{PART}('{part}').getBoundingClientRect().toJSON()")
        assert 0 <= box["left"] < box["right"] <= width, part
        assert 0 <= box["top"] < box["bottom"] <= height, part
    assert shown.run(f"""[...{PART}('.board').querySelectorAll(
      'button, input, select, canvas, svg.graph',
    )].every((it) => it.getAttribute('aria-label') || it.closest('label'))""")
    inked = f"""(() => {{ const it = {PART}('canvas.junction');
      const data = it.getContext('2d').getImageData(0, 0, it.width, it.height).data;
      const places = Array.from({{length: 5000}}, (_, k) => 4 * Math.floor(k * data.length / 2e4));
      return new Set(places.map((at) => data.slice(at, at + 3).join())).size;
    }})()"""
    assert shown.run(inked) > 5, "a picture, not one colour"
    legend = f"{PART}('.legend')"
    if width >= 1000:
        assert shown.run(f"{legend}.scrollHeight <= {legend}.clientHeight"), "the legend is whole"
    shown.run(f"{PLAYER}.time = {START + SECONDS / 2}")
    sizes = f"""[...{PLAYER}.shadowRoot.querySelectorAll('.graph text')].map((it) =>
      it.getScreenCTM().a * parseFloat(getComputedStyle(it).fontSize))"""
    assert min(shown.run(sizes)) >= 10, "pixels of the graph's text"
    kerbs = f"""{PLAYER}.panes.flatMap(({{ scene }}) => scene.ground.holds.map((it, lane) => {{
      const [ux, uy] = scene.ways.find((way) => way.lane === lane).in;
      return scene.kerb * ((it[2] - it[0]) * uy - (it[3] - it[1]) * ux);
    }}))"""
    assert min(shown.run(kerbs)) > 0, "hold lines, and thus signals, end at the kerb"
    at_rest(shown, files[name])


@pytest.mark.slow
@pytest.mark.parametrize("window", WINDOWS)
def test_keys_also_after_clicks(
    browser: Browser, files: dict[str, Path], window: tuple[int, int]
) -> None:
    shown = opened(browser, files["one"], window)
    box = shown.run(f"{PART}('.play').getBoundingClientRect().toJSON()")
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    assert not shown.run(f"{PLAYER}.playing"), "motion is reduced"
    shown.click(*middle)
    assert shown.run(f"{PLAYER}.playing")
    shown.until(f"{PLAYER}.time > {START + 0.3}")
    shown.press(" ")
    assert not shown.run(f"{PLAYER}.playing")
    before = shown.run(f"{PLAYER}.time")
    shown.press("ArrowRight")
    assert shown.run(f"{PLAYER}.time") == pytest.approx(before, abs=0.151)
    shown.press("Home")
    assert shown.run(f"{PLAYER}.time") == START
    for _ in range(3):
        shown.press("ArrowRight")
    shown.press("ArrowLeft")
    assert shown.run(f"{PLAYER}.time") == pytest.approx(START + 0.2)
    assert shown.run(f"{PART}('.clock').textContent") == "60.2 s"
    assert shown.run(f"Number({PART}('.time').value)") == 2
    slider = shown.run(f"{PART}('.time').getBoundingClientRect().toJSON()")
    shown.click(slider["x"] + slider["width"] / 2, slider["y"] + slider["height"] / 2)
    assert shown.run(f"{PLAYER}.time") == pytest.approx(START + SECONDS / 2, abs=1.0)
    shown.press(" ")
    assert shown.run(f"{PLAYER}.playing"), "Space on the slider plays, too"
    shown.press(" ")
    shown.press("End")
    assert shown.run(f"{PLAYER}.time") == START + SECONDS
    shown.press(" ")  # from the start again
    shown.until(f"{PLAYER}.playing && {PLAYER}.time < {START + 5}")
    shown.press(" ")
    at_rest(shown, files["one"])


@pytest.mark.slow
@pytest.mark.parametrize("window", WINDOWS)
def test_decisions_one_after_the_other(
    browser: Browser, files: dict[str, Path], window: tuple[int, int]
) -> None:
    shown = opened(browser, files["one"], window)
    times = []
    for _ in range(3):
        shown.run(f"{PART}('.on').click()")
        times.append(shown.run(f"{PLAYER}.time"))
    assert times == sorted(set(times))
    goes = f"{PLAYER}.panes[0].cars.filter((it) => it.goes).map((it) => it.track.id)"
    now = set(shown.run(goes))
    shown.run(f"{PLAYER}.time -= 0.1")
    assert now - set(shown.run(goes)), "a vehicle has got the right of way"
    shown.run(f"{PART}('.back').click()")
    assert shown.run(f"{PLAYER}.time") == pytest.approx(times[1])
    vehicle, _ = go_to_a_wait(shown, "other clique")
    shown.run(f"{PLAYER}.select({vehicle})")
    before = shown.run(f"{PART}('.why').textContent")
    shown.run(f"{PART}('.on').click()")
    assert shown.run(f"{PART}('.why').textContent") != before, (
        "of the chosen vehicle: its next reason"
    )


@pytest.mark.slow
@pytest.mark.parametrize("window", WINDOWS)
def test_the_graph_the_strip_and_the_marks_follow_the_choice(
    browser: Browser, files: dict[str, Path], window: tuple[int, int]
) -> None:
    shown = opened(browser, files["one"], window)
    vehicle, why = go_to_a_wait(shown, "other clique")
    copied = f"{PART}('canvas.junction').toDataURL()"
    plain = shown.run(copied)
    shown.click(*where(shown, vehicle))
    assert shown.run(f"{PART}('.why').textContent") == why["sentence"]
    assert shown.run(copied) != plain, "rings, ways and crossings are drawn"
    label = shown.run(f"{PART}('.graph').getAttribute('aria-label')")
    goes, waits = label.split("Wait:")
    assert all(f"(vehicle {other})" in goes for other in why["others"])
    assert f"(vehicle {vehicle})" in waits
    assert shown.run(f"{PART}('.graph').querySelectorAll('.node.goes').length") >= 1
    assert shown.run(f"{PART}('.graph').querySelectorAll('.node.chosen').length") == 1
    lane = shown.run(f"{PLAYER}.panes[0].cars.find((it) => it.track.id === {vehicle}).track.lane")
    assert shown.run(f"{PLAYER}.lane") == lane
    strip = f"{PART}('.strip').toDataURL()"
    one = shown.run(strip)
    shown.run(f"""(() => {{ const it = {PLAYER}.lanes; it.value = {(lane + 1) % 4};
      it.dispatchEvent(new Event('change')); }})()""")
    assert shown.run(strip) != one
    shown.press("Escape")
    shown.run(f"{PLAYER}.board.focus()")
    shown.press("Escape")
    assert shown.run(f"{PLAYER}.chosen") is None
    shown.press("n")
    assert shown.run(f"{PLAYER}.chosen") is not None
    at_rest(shown, files["one"])


@pytest.mark.slow
@pytest.mark.parametrize("window", WINDOWS)
def test_two_runs_share_the_clock_and_the_choice(
    browser: Browser, files: dict[str, Path], runs: list[Run], window: tuple[int, int]
) -> None:
    shown = opened(browser, files["two"], window)
    shown.run(f"{PLAYER}.time = 75")
    both = shown.run(f"""{PLAYER}.panes[0].cars.map((it) => it.track.id).find((id) =>
      {PLAYER}.panes[1].cars.some((it) => it.track.id === id &&
        Math.max(Math.abs(it.x), Math.abs(it.y)) < 35))""")
    shown.click(*where(shown, both, pane=1))
    assert shown.run(f"{PLAYER}.chosen") == both
    said = shown.run(f"{PLAYER}.panes.map((it) => it.why.textContent)")
    for run, text in zip(runs, said, strict=True):
        assert text.startswith(run.why(both, 75.0).sentence)
    assert shown.run(f"{PLAYER}.panes.map((it) => it.name.textContent)") == ["dim", "fixed-time"]


@pytest.mark.slow
def test_in_a_page_as_wide_as_the_site_both_runs_say_why_beside_each_other(
    browser: Browser, files: dict[str, Path]
) -> None:
    shown = opened(browser, files["two"], (880, HEIGHTS[1]))
    for part in ("canvas", "panel"):
        one, other = shown.run(f"{PLAYER}.panes.map((it) => it.{part}.getBoundingClientRect().top)")
        assert one == other < HEIGHTS[1] - 200
    at_rest(shown, files["two"])


@pytest.mark.slow
@pytest.mark.parametrize("window", WINDOWS)
def test_the_other_controls(
    browser: Browser, files: dict[str, Path], window: tuple[int, int]
) -> None:
    """Speed, the vehicle's number, the name of an arm, and the legend."""
    shown = opened(browser, files["one"], window)
    passed = shown.run(f"""new Promise((done) => {{
      const player = {PLAYER}, from = player.time, at = performance.now();
      player.rate.value = "8";
      player.rate.dispatchEvent(new Event("change"));
      player.play(true);
      setTimeout(() => done((player.time - from) / (performance.now() - at) * 1000), 600);
    }})""")
    assert passed == pytest.approx(8.0, rel=0.25)
    shown.run(f"{PLAYER}.play(false)")
    vehicle, why = go_to_a_wait(shown, "other clique")
    shown.run(f"{PLAYER}.number.focus()")
    for digit in str(vehicle):
        shown.ask("Input.insertText", text=digit)
    assert shown.run(f"{PART}('.why').textContent") == why["sentence"]
    x, y = shown.run(f"""(() => {{ const pane = {PLAYER}.panes[0], [x, y] = pane.namePlaces()[2];
      const box = pane.canvas.getBoundingClientRect(), k = box.width / (2 * {PLAYER}.reach);
      return [box.left + box.width / 2 + k * x, box.top + box.height / 2 - k * y]; }})()""")
    shown.click(x, y)
    assert shown.run(f"[{PLAYER}.chosen, {PLAYER}.lane, {PLAYER}.lanes.value]") == [None, 2, "2"]
    assert "lane c" in shown.run(f"{PART}('.strip').getAttribute('aria-label')")
    listed = [shown.run(f"({PART}('.legend summary').click(), {PART}('.legend').offsetHeight)")
              for _ in range(2)]  # fmt: skip
    assert 0 < 2 * listed[0] < listed[1], "folded, and open again"
    at_rest(shown, files["one"])


@pytest.mark.slow
def test_cars_are_where_the_run_has_them(
    browser: Browser, files: dict[str, Path], runs: list[Run]
) -> None:
    shown = opened(browser, files["one"], (1280, 720))
    frame = runs[0].trajectories
    for time in (61.3, 70.0, 82.9):
        rows = frame[(frame.time_s - time).abs() < 0.01].set_index("vehicle")
        shown.run(f"{PLAYER}.time = {time}")
        cars = shown.run(f"""{PLAYER}.panes[0].cars.map((it) =>
          [it.track.id, it.x, it.y, Math.atan2(it.ux, it.uy) * 180 / Math.PI])""")
        assert len(cars) > 5
        for vehicle, x, y, angle in cars:
            row = rows.loc[vehicle]
            assert (x, y) == pytest.approx((row.x_m, row.y_m), abs=0.01)
            assert abs((angle - row.angle_deg + 180.0) % 360.0 - 180.0) < 0.2


@pytest.mark.slow
def test_it_moves_smoothly(browser: Browser, files: dict[str, Path]) -> None:
    shown = opened(browser, files["two"], (1920, 950), calm=False)
    assert shown.run(f"{PLAYER}.playing"), "it plays by itself"
    before = shown.busy()
    frames = shown.run(f"""new Promise((done) => {{
      const player = {PLAYER}; let count = 0; const draw = player.draw;
      player.draw = function () {{ count++; draw.call(this); }};
      setTimeout(() => done(count), 2000);
    }})""")
    assert (shown.busy() - before) / frames < 1 / 50, "seconds for a frame"


@pytest.mark.slow
def test_two_players_on_one_page(browser: Browser, runs: list[Run], tmp_path: Path) -> None:
    scenes = [scene(it, start=START, seconds=SECONDS) for it in runs]
    held = "".join(
        f'<minisim-player><script type="application/json">{dumped([it])}</script></minisim-player>'
        for it in scenes
    )
    file = tmp_path / "page.html"
    twice = f'<script type="module">{script()}</script>' * 2
    head = '<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,">'
    file.write_text(
        f"{head}<style>p {{ color: rgb(1, 2, 3) }}</style><p>text</p><button>mine</button>"
        f"{held}{twice}", encoding="utf-8",
    )  # fmt: skip
    shown = browser.page(calm=True)
    shown.size(1280, 900)
    shown.open(file.as_uri())
    all_of = "[...document.querySelectorAll('minisim-player')]"
    shown.until(f"{all_of}.every((it) => it.panes && it.panes.length === 1)")
    shown.run(f"{all_of}[1].board.focus()")
    shown.press(" ")
    assert shown.run(f"{all_of}.map((it) => it.playing)") == [False, True]
    shown.press(" ")
    shown.press("n")
    assert shown.run(f"{all_of}.map((it) => it.chosen === null)") == [True, False]
    assert shown.run("getComputedStyle(document.querySelector('p')).color") == "rgb(1, 2, 3)"
    lone = tmp_path / "lone.html"
    lone.write_text(f"{head}<button>mine</button>", encoding="utf-8")
    plain = browser.page()
    plain.open(lone.as_uri())
    styled = "getComputedStyle(document.querySelector('button')).border"
    assert shown.run(styled) == plain.run(styled)
    known = "Object.keys(window).length"
    assert shown.run(known) == plain.run(known), "no globals"
    at_rest(shown, file)


@pytest.mark.slow
def test_two_players_in_one_notebook(browser: Browser, runs: list[Run], tmp_path: Path) -> None:
    """As a saved notebook holds them: what one does, the other does not."""
    height = HEIGHTS[0]
    shows = "".join(play(it, start=START, seconds=SECONDS)._repr_html_() for it in runs)
    file = tmp_path / "notebook.html"
    file.write_text(f'<!doctype html><link rel="icon" href="data:,">{shows}', encoding="utf-8")
    shown = browser.page()
    shown.size(1000, 2 * height + 40)
    shown.open(file.as_uri())

    def looks() -> list[Image.Image]:
        shown.picture(tmp_path / "seen.png")
        seen = Image.open(tmp_path / "seen.png")
        return [seen.crop((20, y + 70, 400, y + 400)) for y in (8, 8 + height)]  # the junctions

    def until(changed: tuple[bool, bool]) -> list[Image.Image]:
        for _ in range(100):
            now = looks()
            if tuple(a != b for a, b in zip(before, now, strict=True)) == changed:
                return now
        raise AssertionError(f"never changed as {changed}")

    shown.run("new Promise((done) => setTimeout(done, 500))")
    before = looks()
    shown.click(45, height - 30)  # the first one's play button
    before = until((True, False))
    shown.press(" ")
    before = looks()
    assert looks() == before, "Space stops the one that was clicked"
    shown.click(45, 2 * height - 30)
    until((False, True))
    at_rest(shown, file)


@pytest.mark.slow
def test_a_collision_is_counted(browser: Browser, tmp_path: Path) -> None:
    crash = replayed(four_way(), (0.0, 0, 2), (0.0, 1, 2), horizon=60.0)
    run = minisim.simulate(crash, Unregulated(), record="all", on_collision="record", explain=True)
    file = tmp_path / "crash.html"
    Player(scene(run, start=20.0, seconds=35.0)).save(file)
    shown = opened(browser, file, (1280, 720))
    shown.run(f"{PLAYER}.time = {PLAYER}.last")
    assert shown.run(f"{PART}('.counts').textContent").startswith("collisions 1 · in queues")
    assert shown.run(f"{PART}('.counts').textContent").endswith("served 0")
    shown.run(f"{PLAYER}.select(1)")
    assert shown.run(f"{PART}('.why').textContent").startswith(
        "It has collided with vehicle 0. Veh"
    )
    assert "2 recorded arrivals" in shown.run(f"{PART}('.what').textContent")
    assert "crossed out" in shown.run(f"{PART}('.legend').textContent")
    at_rest(shown, file)


@pytest.mark.slow
def test_a_scene_can_be_changed_for_another(
    browser: Browser, files: dict[str, Path], runs: list[Run]
) -> None:
    shown = opened(browser, files["one"], (1280, 720))
    shown.run(f"{PLAYER}.time = 70")
    other = json.dumps([scene(runs[1], start=START, seconds=SECONDS)])
    shown.run(f"{PLAYER}.show({other})")
    assert shown.run(f"{PLAYER}.time") == 70
    assert shown.run(f"{PLAYER}.panes.map((it) => it.name.textContent)") == ["fixed-time"]
