"""A web page that plays one run or two side by side, in one file that needs no other."""

from __future__ import annotations

import html
import json
import re
from importlib import resources

from figures.player.ground import look
from figures.player.scene import Scene, dumped, scene
from minisim.errors import InputError
from minisim.files import AnyPath, write_text
from minisim.results.run import Run


def write_player(
    path: AnyPath, run: Run, beside: Run | None = None, *, start: float = 0.0, seconds: float = 60.0
) -> None:
    """Write a page that plays `seconds` of a run from `start` on [s], perhaps `beside` another one.

    Click a vehicle there to read why it waits. Two runs share one clock.

    Raises `InputError` as `scene`, or for runs with different arrivals, and `FileError` if the file
    cannot be written.
    """
    runs = [run] if beside is None else [run, beside]
    write_page(path, *(scene(it, start=start, seconds=seconds) for it in runs))


def write_page(path: AnyPath, one: Scene, other: Scene | None = None) -> None:
    """Write a page that plays one scene or two; raises as `write_player`."""
    write_text(path, page(one, other))


def page(one: Scene, other: Scene | None = None) -> str:
    """The page as a text; see `write_page`."""
    scenes = [one] if other is None else [one, other]
    if other is not None and (different := different_arrivals(one, other)):
        raise InputError(f"two runs side by side need the same arrivals: {different}")
    names = " beside ".join(it["controller"] for it in scenes)
    fields = {
        "title": html.escape(f"{one['title']} · {names}"),
        "scenes": dumped(scenes).replace("<", r"\u003c"),
        "player": script(),
    }
    return template("template.html", **fields)


def script() -> str:
    """The player as one JavaScript module, its style sheet inside; it defines `minisim-player`."""
    colours = "".join(f"--{name}: {colour}; " for name, colour in look().items())
    sheet = f":host {{ {colours}}}\n{_file('player.css')}"
    quoted = json.dumps(sheet).replace("<", r"\u003c")
    return f"const STYLE = {quoted};\n{_file('player.js')}"


def different_arrivals(one: Scene, other: Scene) -> str:
    """What tells the arrivals of two scenes apart; empty if nothing does."""
    for key, what in (("title", "scenario"), ("demand", "demand"), ("seed", "seed")):
        if one[key] != other[key]:
            return f"{what} {one[key]} and {other[key]}"
    came = [{it["id"]: it["way"] for it in scene["tracks"]} for scene in (one, other)]
    for vehicle in sorted(came[0].keys() & came[1].keys()):
        ways = [
            scene["ways"][by[vehicle]]["name"] for scene, by in zip((one, other), came, strict=True)
        ]
        if ways[0] != ways[1]:
            return f"vehicle {vehicle} takes {ways[0]} and {ways[1]}"
    return ""


def template(name: str, **fields: str) -> str:
    """A template of this folder, with its fields filled in."""
    return re.sub(r"\{\{(\w+)\}\}", lambda found: fields[found[1]], _file(name))


def _file(name: str) -> str:
    return (resources.files("figures.player") / name).read_text(encoding="utf-8")
