"""The lab in a real browser: sliders simulate, and an address holds the setting."""

from __future__ import annotations

import base64
import json
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from figures.player.lab import LabServer, answered, lab_page
from minisim.parameters import parameters
from scenarios.lab import Setting
from tests import ROOT
from tests.browser.chromium import Browser, Page, browser_path, chromium

pytestmark = [
    pytest.mark.browser,
    pytest.mark.slow,
    pytest.mark.skipif(browser_path() is None, reason="needs chromium or chrome"),
]

PLAYER = "document.querySelector('minisim-player')"
EXPLAINED = f"{PLAYER}.panes.length && {PLAYER}.panes.every((it) => it.scene.data.reasons)"


@pytest.fixture(scope="module")
def lab() -> Iterator[LabServer]:
    with LabServer() as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with chromium(tmp_path_factory.mktemp("chromium")) as running:
        yield running


def opened(
    browser: Browser, lab: LabServer, setting: str, window: tuple[int, int] = (1280, 720)
) -> Page:
    shown = browser.page(calm=True)
    shown.size(*window)
    shown.open(f"{lab.address}#{setting}")
    return shown


def put(shown: Page, name: str, value: object) -> None:
    """Move a slider or choose a word, as a hand does."""
    shown.run(f"""(() => {{ const it = document.querySelector('[name="{name}"]');
      it.value = '{value}'; it.dispatchEvent(new Event('input', {{ bubbles: true }})); }})()""")


def test_sliders_simulate_and_the_address_holds_them(browser: Browser, lab: LabServer) -> None:
    shown = opened(browser, lab, "seconds=60")
    shown.until(EXPLAINED)
    assert shown.run(f"{PLAYER}.panes.map((it) => it.name.textContent)") == ["dim"]
    shown.run(f"{PLAYER}.time = 50")
    put(shown, "density", 200)
    put(shown, "gate", "harmonious")
    put(shown, "beside", "adaptive")
    shown.until(f"{PLAYER}.panes.length === 2 && {EXPLAINED}")
    names = ["dim:gate=harmonious", "adaptive"]
    assert shown.run(f"{PLAYER}.panes.map((it) => it.name.textContent)") == names
    assert shown.run(f"{PLAYER}.time") == 50, "the moment stays"
    setting = shown.run("location.hash")
    assert setting == "#beside=adaptive&density=200&gate=harmonious&seconds=60"
    other = opened(browser, lab, setting[1:])
    other.until(f"{PLAYER}.panes.length === 2 && {EXPLAINED}")
    tracks = f"JSON.stringify({PLAYER}.panes.map((it) => it.scene.data.tracks))"
    assert other.run(tracks) == shown.run(tracks)
    assert other.run("document.querySelector('[name=\"density\"]').value") == "200"
    assert "--beside adaptive" in other.run("document.getElementById('command').textContent")
    for page in (shown, other):
        assert page.errors == []
        assert all(it.startswith(lab.address) for it in page.requests)


def test_what_has_no_effect_cannot_be_moved(browser: Browser, lab: LabServer) -> None:
    shown = opened(browser, lab, "humans=0.5&seconds=60")
    shown.until(EXPLAINED)
    put(shown, "controller", "fixed-time")
    shown.until(f"{PLAYER}.panes[0].name.textContent === 'fixed-time' && {EXPLAINED}")
    assert shown.run("document.querySelector('[name=\"humans\"]').disabled")
    assert shown.run("location.hash") == "#controller=fixed-time&seconds=60"
    assert shown.errors == []


def test_a_wrong_value_in_an_address_is_told(browser: Browser, lab: LabServer) -> None:
    shown = opened(browser, lab, "density=350&gait=clear", (390, 844))
    shown.until("document.getElementById('said').textContent")
    assert "did you mean 'gate'" in shown.run("document.getElementById('said').innerText")
    put(shown, "density", 100)
    shown.until(EXPLAINED)
    assert shown.run("document.getElementById('said').textContent") == ""


@pytest.mark.parametrize("window", [(390, 844), (1280, 720), (1920, 950)])
def test_the_play_button_is_in_view(
    browser: Browser, lab: LabServer, window: tuple[int, int]
) -> None:
    setting = "seconds=60&arms=5&gate=harmonious&beside=adaptive"
    shown = opened(browser, lab, setting, window)
    shown.until(EXPLAINED)
    box = shown.run(f"{PLAYER}.shadowRoot.querySelector('.play').getBoundingClientRect().toJSON()")
    assert 0 <= box["left"] < box["right"] <= window[0]
    assert 0 <= box["top"] < box["bottom"] <= window[1]
    assert shown.run("document.documentElement.scrollWidth") <= window[0]
    for pane in (0, 1):
        picture = shown.run(f"{PLAYER}.panes[{pane}].canvas.getBoundingClientRect().toJSON()")
        assert picture["bottom"] <= box["top"], "the controls do not cover the picture"


#: A value of each control that is not its default.
OTHERS = {
    "controller": "adaptive", "beside": "reservation", "arms": 5, "density": 210, "gate": "passed",
    "humans": 0.25, "error": 0.1, "profile": "fair", "seed": 7, "seconds": 90,
}  # fmt: skip


@pytest.mark.parametrize("name", [it.name for it in parameters(Setting)])
def test_each_control_is_in_the_address_and_simulates(
    browser: Browser, lab: LabServer, name: str
) -> None:
    shown = opened(browser, lab, "seconds=60")
    shown.until(EXPLAINED)
    before = shown.run(f"JSON.stringify({PLAYER}.panes.map((it) => it.scene.data))")
    put(shown, name, OTHERS[name])
    shown.until(f"location.hash.includes('{name}={OTHERS[name]}')")
    shown.until(f"""{EXPLAINED} && !document.getElementById('state').textContent.includes('simul')
      && JSON.stringify({PLAYER}.panes.map((it) => it.scene.data)) !== {json.dumps(before)}""")
    known = Setting.read(shown.run("location.hash.slice(1)"))
    assert str(getattr(known, name)).removesuffix(".0") == str(OTHERS[name])
    assert shown.run("document.getElementById('command').textContent") == known.command
    assert shown.errors == []


@pytest.mark.parametrize(("file", "begins"), [
    ("film.html", b"<!doctype html>"), ("film.gif", b"GIF89a"),
    ("scene.json", b'{"format":"minisim scene"'),
])  # fmt: skip
def test_an_export_is_a_download(
    browser: Browser, lab: LabServer, tmp_path: Path, file: str, begins: bytes
) -> None:
    shown = opened(browser, lab, "seconds=30&density=400")
    shown.until(EXPLAINED)
    shown.ask("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    shown.run(f"""document.querySelector('[data-as="{file}"]').click()""")
    shown.until("!document.getElementById('state').textContent.startsWith('making')", 120.0)
    for _ in range(100):
        if (tmp_path / file).exists():
            break
        shown.run("new Promise((done) => setTimeout(done, 20))")
    assert (tmp_path / file).read_bytes().startswith(begins)


def test_in_a_notebook_the_kernel_answers(browser: Browser, tmp_path: Path) -> None:
    """The page is in a frame that reaches nothing; the widget carries its questions."""
    widget = (ROOT / "figures/player/notebook.js").read_text(encoding="utf-8")
    page = json.dumps(lab_page("seconds=60")).replace("<", r"\u003c")
    file = tmp_path / "notebook.html"
    file.write_text(f"""<!doctype html><link rel="icon" href="data:,"><div id="cell"></div><script>
      {widget.replace("export default", "const widget =")}
      const asked = [];
      let answer;
      const model = {{ get: () => {page}, send: (it) => asked.push(it),
                      on: (_, f) => {{ answer = f; }}, off() {{}} }};
      const stop = widget.render({{ model, el: document.getElementById("cell") }});
    </script>""", encoding="utf-8")  # fmt: skip
    shown = browser.page(calm=True)
    shown.size(1280, 800)
    shown.open(file.as_uri())

    def questions() -> list[str]:
        """Answer all questions until the reasons are there."""
        told = []
        while not told or "explained=1" not in told[-1]:
            shown.until("asked.length")
            question = shown.run("asked.shift()")
            said = answered(question["what"], question["query"])
            data = base64.b64encode(said.data).decode()
            shown.run(f"""answer({{ id: {question["id"]}, status: {int(said.status)} }},
              [new DataView(Uint8Array.from(atob("{data}"), (it) => it.charCodeAt()).buffer)])""")
            told.append(question["query"])
        return told

    assert questions() == [f"seconds=60&run=0&explained={k}" for k in (0, 1)]
    for _ in range(8):  # into the frame, and from control to control until one changes
        shown.press("Tab")
        shown.press("ArrowRight")
        if shown.run("new Promise((done) => setTimeout(() => done(asked.length), 400))"):
            break
    assert questions()[-1].endswith("&seconds=60&run=0&explained=1")
    assert shown.errors == []
    assert set(shown.requests) - {"about:srcdoc"} == {file.as_uri()}
    shown.run("stop()")
