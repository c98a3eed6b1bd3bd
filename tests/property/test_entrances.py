"""One entrance, one answer: the same recipe gives the same numbers however it is said."""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
from pathlib import Path
from typing import Any

from hypothesis import example, given
from hypothesis import strategies as st

from minisim.results.metrics import METRICS
from scenarios.cli import main
from scenarios.controllers import controller_named
from scenarios.library import scenario_named
from scenarios.recipe import Recipe
from scenarios.sweep import Store
from tests.builders import share

NOISY = "dim:perception=noisy(intent_error=0.25,kind=symmetric)"
CONTROLLERS = ("dim", "dim:gate=harmonious", NOISY, "fixed-time", "all-way-stop", "v2ic")
#: All metrics that give the same number twice; the counts of a tally are not asked for.
ASKED = [it.name for it in METRICS.values() if it.needs not in ("decisions", "counts")]
FAULTS = ("latency", "jitter", "loss")
TALLY = {"crossings", "false_grants", "disagreement_s", "deadlock_s"}


def answered(*arguments: str) -> str:
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        assert main(arguments) == 0
    return printed.getvalue()


def _flag(key: str) -> str:
    return f"--{key.replace('_', '-')}"


def flat(summary: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in summary.items():
        inner = flat(value, f"{prefix}{key}_") if isinstance(value, dict) else None
        found |= {f"{prefix}{key}": value} if inner is None else inner
    return found


@st.composite
def said(draw: st.DrawFn) -> dict[str, Any]:
    """A recipe as a TOML file has it; the keys are those of the command line."""
    controller = draw(st.sampled_from(CONTROLLERS))
    humans = draw(st.sampled_from([0.0, 0.3])) if controller.startswith("dim") else 0.0
    fails = st.sampled_from([0.0, 0.3]) if controller == "v2ic" else st.just(0.0)
    return {
        "scenario": draw(st.sampled_from(["three-way", "four-way"])),
        "controller": controller,
        "humans": humans,
        **{name: draw(fails) for name in FAULTS},
        "density": draw(st.sampled_from([150.0, 400.0])),
        "turns": "uniform",
        "profile": draw(st.sampled_from(["paper", "fair"])),
        "side": draw(st.sampled_from(["left", "right"])),
        "horizon": draw(st.sampled_from([60.0, 150.0])),
        "demand_time": draw(st.sampled_from([40.0, 60.0])),
        "warmup": draw(st.sampled_from([0.0, 20.0])),
        "seed": draw(st.integers(0, 5)),
    }


ERRING = {
    "scenario": "four-way", "controller": NOISY, "density": 400.0, "split": "4:3:2:1",
    "profile": "fair", "side": "left", "horizon": 300.0, "demand_time": 290.0, "warmup": 30.0,
    "seed": 1,
}  # fmt: skip


@given(said())
@example({**ERRING, "humans": 0.0})
@example({**ERRING, "humans": 0.3})
@example({
    **ERRING, "controller": "dim", "humans": 0.3, "horizon": 60.0, "demand_time": 60.0,
    "warmup": 20.0, "seed": 3,
})  # fmt: skip
@example({**ERRING, "controller": "reservation", "latency": 0.2, "jitter": 0.1, "loss": 0.3})
@share(0.05)
def test_the_same_recipe_has_the_same_numbers_everywhere(said: dict[str, Any]) -> None:
    options = {**said, "on-collision": "record"}
    scenario = options.pop("scenario")
    words = [w for key, value in options.items() for w in (_flag(key), str(value))]
    words += ["--metrics", ",".join(ASKED), "--json"]
    printed = flat(json.loads(answered("run", scenario, *words)))

    keys = {**said, "on_collision": "record", "metrics": ASKED}
    keys["seeds"] = [keys.pop("seed")]
    with tempfile.TemporaryDirectory() as folder:
        file, store = Path(folder, "same.toml"), str(Path(folder, "same.db"))
        file.write_text("".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items()))
        answered("sweep", str(file), "--out", store, "--jobs", "1")
        (row,) = Store(store).frame().astype(object).to_dict("records")

    demand = {key: said[key] for key in ("density", "split", "turns") if key in said}
    drawn = scenario_named(
        scenario, **demand, profile=said["profile"], side=said["side"],
        horizon=said["horizon"], warmup=said["warmup"], demand_time=said["demand_time"],
    )  # fmt: skip
    recipe = Recipe(
        drawn, controller_named(said["controller"], said["profile"]), said["seed"],
        on_collision="record", metrics=ASKED,
        **{name: said[name] for name in ("humans", *FAULTS) if name in said},
    )  # fmt: skip
    run = recipe.run()
    ours = flat(run.summary(recipe.metrics))

    assert printed == json.loads(json.dumps(ours))
    assert {key: None if row[key] != row[key] else row[key] for key in ours} == ours
    assert (printed.keys() >= TALLY) is (said["controller"] == NOISY)
    kinds = set(run.trips["kind"]) if said.get("humans") else set()
    assert any(key.startswith("kinds_human_") for key in printed) is ("human" in kinds)
