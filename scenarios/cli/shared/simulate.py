"""Runs with a progress bar."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import typer

from scenarios.cli.shared.terminal import bar
from scenarios.termination import Terminated

if TYPE_CHECKING:
    from minisim.results.run import Run
    from scenarios.scenario import Scenario


def simulate(
    scenario: Scenario, controller: Any, seed: int, until: float = math.inf, **options: Any
) -> Run:
    """Run in parts, with a progress bar and the usual result, up to `until` [s] at most."""
    from minisim.simulation import Simulation

    simulation = Simulation(scenario, controller, seed=seed, **options)
    parts, end = 100, min(until, scenario.horizon)
    with bar("simulating") as progress:
        for part in range(1, parts + 1):
            simulation.advance(end * part / parts)
            progress(part, parts)
    return simulation.result()


def simulate_in_sumo(scenario: Scenario, controller: Any, seed: int, **options: Any) -> Run:
    """Like `simulate`, but in SUMO."""
    from minisim.sumo import simulate as sumo_simulate

    try:
        with bar("simulating in SUMO") as progress:
            return sumo_simulate(scenario, controller, seed, progress=progress, **options)
    except (KeyboardInterrupt, Terminated) as end:
        for note in getattr(end, "__notes__", ()):
            typer.echo(f"minisim: {note}", err=True)
        raise
