"""The lab in a real browser: sliders simulate, and an address holds the setting."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from figures.player.lab import Lab
from tests.browser.chromium import Browser, Page, browser_path, chromium

pytestmark = [
    pytest.mark.browser,
    pytest.mark.slow,
    pytest.mark.skipif(browser_path() is None, reason="needs chromium or chrome"),
]

PLAYER = "document.querySelector('minisim-player')"
EXPLAINED = f"{PLAYER}.panes.length && {PLAYER}.panes.every((it) => it.scene.data.reasons)"


@pytest.fixture(scope="module")
def lab() -> Iterator[Lab]:
    with Lab() as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with chromium(tmp_path_factory.mktemp("chromium")) as running:
        yield running


def opened(browser: Browser, lab: Lab, setting: str, window: tuple[int, int] = (1280, 720)) -> Page:
    shown = browser.page(calm=True)
    shown.size(*window)
    shown.open(f"{lab.address}#{setting}")
    return shown


def put(shown: Page, name: str, value: object) -> None:
    """Move a slider or choose a word, as a hand does."""
    shown.run(f"""(() => {{ const it = document.querySelector('[name="{name}"]');
      it.value = '{value}'; it.dispatchEvent(new Event('input', {{ bubbles: true }})); }})()""")


def test_sliders_simulate_and_the_address_holds_them(browser: Browser, lab: Lab) -> None:
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


def test_what_has_no_effect_cannot_be_moved(browser: Browser, lab: Lab) -> None:
    shown = opened(browser, lab, "humans=0.5&seconds=60")
    shown.until(EXPLAINED)
    put(shown, "controller", "fixed-time")
    shown.until(f"{PLAYER}.panes[0].name.textContent === 'fixed-time' && {EXPLAINED}")
    assert shown.run("document.querySelector('[name=\"humans\"]').disabled")
    assert shown.run("location.hash") == "#controller=fixed-time&seconds=60"
    assert shown.errors == []


def test_a_wrong_value_in_an_address_is_told(browser: Browser, lab: Lab) -> None:
    shown = opened(browser, lab, "density=350&gait=clear")
    shown.until("document.getElementById('said').textContent")
    assert "did you mean 'gate'" in shown.run("document.getElementById('said').textContent")
    put(shown, "density", 100)
    shown.until(EXPLAINED)
    assert shown.run("document.getElementById('said').textContent") == ""


@pytest.mark.parametrize("window", [(390, 844), (1280, 720), (1920, 950)])
def test_the_play_button_is_in_view(browser: Browser, lab: Lab, window: tuple[int, int]) -> None:
    shown = opened(browser, lab, "seconds=60&arms=5&gate=harmonious", window)
    shown.until(EXPLAINED)
    box = shown.run(f"{PLAYER}.shadowRoot.querySelector('.play').getBoundingClientRect().toJSON()")
    assert 0 <= box["left"] < box["right"] <= window[0]
    assert 0 <= box["top"] < box["bottom"] <= window[1]
    assert shown.run("document.documentElement.scrollWidth") <= window[0]
    picture = shown.run(f"{PLAYER}.panes[0].canvas.getBoundingClientRect().toJSON()")
    assert picture["bottom"] <= box["top"], "the controls do not cover the picture"


def test_an_export_is_a_download(browser: Browser, lab: Lab, tmp_path: Path) -> None:
    shown = opened(browser, lab, "seconds=60&density=200")
    shown.until(EXPLAINED)
    shown.ask("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    shown.run("document.querySelector('[data-as=\"scene.json\"]').click()")
    shown.until("!document.getElementById('state').textContent.startsWith('making')")
    shown.until("true")
    for _ in range(100):
        if (tmp_path / "scene.json").exists():
            break
        shown.run("new Promise((done) => setTimeout(done, 20))")
    assert (tmp_path / "scene.json").read_text().startswith('{"format":"minisim scene"')
