"""Settings of the lab: an address holds them, and the command line shows the same."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import minisim
from figures import scene
from figures.player.scene import dumped
from minisim.errors import InputError
from scenarios.cli import main
from scenarios.lab import CHOICES, NONE, Setting

SHARES = st.integers(0, 20).map(lambda k: k / 20)


@st.composite
def settings(draw: st.DrawFn) -> Setting:
    controller, beside = draw(st.sampled_from(CHOICES)), draw(st.sampled_from((NONE, *CHOICES)))
    dim = "dim" in (controller, beside)
    return Setting(
        controller=controller, beside=beside, arms=draw(st.integers(3, 8)),
        density=draw(st.floats(0, 1000)), seed=draw(st.integers(0, 10**6)),
        gate=draw(st.sampled_from(("clear", "harmonious", "passed"))) if dim else "clear",
        humans=draw(SHARES) if dim else 0.0, error=draw(SHARES) if dim else 0.0,
        profile=draw(st.sampled_from(("paper", "fair"))), seconds=draw(st.floats(1, 1800)),
    )  # fmt: skip


@given(settings())
def test_an_address_holds_a_setting(setting: Setting) -> None:
    assert Setting.read(str(setting)) == setting
    assert len(setting.recipes) == 2 - (setting.beside == NONE)


def test_the_default_needs_no_words() -> None:
    assert str(Setting()) == ""
    assert Setting.read("") == Setting()
    assert str(Setting(density=200.0, humans=0.5)) == "density=200&humans=0.5"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("controller=dmi", "did you mean 'dim'"),
        ("controller=mine:Own", "unknown controller 'mine:Own'"),
        ("densty=3", "did you mean 'density'"),
        ("density=many", "density"),
        ("density=nan", "finite"),
        ("arms=4.5", "arms must be an integer 3 … 8"),
        ("arms=", "arms"),
        ("density=3&density=4", "density is given twice: 3.0 and '4'"),
        ("controller=adaptive&humans=0.5", "humans has an effect only on dim, not on adaptive"),
        ("humans=2", "share|humans"),
        ("seconds=1e9", "seconds"),
        ("&".join(f"x{k}=1" for k in range(2000)), "unknown Setting parameter 'x0'"),
    ],
)
def test_wrong_settings_are_told_in_a_sentence(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        Setting.read(text)


@pytest.mark.parametrize(
    "text",
    [
        "gate=harmonious&density=300&seed=2&seconds=60&humans=0.3",
        "controller=fixed-time&arms=3&profile=fair&seconds=60&error=0.2&beside=dim&seed=1",
        pytest.param(
            "arms=6&seconds=60&error=0.1&beside=reservation&humans=0.2", marks=pytest.mark.slow
        ),
    ],
)
def test_the_command_line_shows_the_same(text: str, tmp_path: Path) -> None:
    setting, file = Setting.read(text), tmp_path / "film.html"
    wanted = [
        scene(recipe.run(minisim.simulate, record="all", explain=True), seconds=setting.seconds)
        for recipe in setting.recipes
    ]
    shown = []
    for line in setting.command.splitlines():
        assert main([*shlex.split(line)[1:], "-o", str(file)]) == 0
        held = file.read_text(encoding="utf-8").partition('"application/json">')[2]
        shown += json.loads(held.partition("</script>")[0])
    assert shown == json.loads(dumped(wanted))
