"""Helpers for tests that show views made by hand to a session."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable

from minisim.control import Command, Controller, Observed, Session, Site, View, Wake


def seen(id: int, lane: int, manoeuvre: int, distance: float, speed: float = 0.0) -> Observed:
    """One vehicle of 5 m."""
    return Observed(id, lane, manoeuvre, distance, speed, 5.0)


def said(commands: Iterable[Command]) -> list[str]:
    """Commands in words; as a reader would say it."""
    return [f"{type(command).__name__} {dataclasses.astuple(command)[0]:g}" for command in commands]


def show(session: Session, time: float, *vehicles: Observed) -> list[str]:
    """The answer to a view, but for its wake-ups."""
    answer = session.decide(View(time, vehicles))
    return said(command for command in answer if not isinstance(command, Wake))


def drive(
    controller: Controller,
    site: Site,
    until: float,
    vehicles: Callable[[float], tuple[Observed, ...]] = lambda time: (),
) -> dict[float, list[str]]:
    """Commands by time of a session that a host wakes when it asked for it, and then only."""
    session = controller.start(site)
    answers: dict[float, list[str]] = {}
    tick = 0
    while tick * site.dt < until:
        time = round(tick * site.dt, 6)
        commands = list(session.decide(View(time, vehicles(time))))
        (wake,) = [c for c in commands if isinstance(c, Wake)]
        answers[time] = said(c for c in commands if c is not wake)
        tick, before = math.ceil(wake.time / site.dt - 1e-6), tick
        assert tick > before
    return {time: commands for time, commands in answers.items() if commands}
