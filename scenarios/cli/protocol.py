"""`minisim protocol`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from minisim.errors import InputError, choice
from minisim.junction.geometry import ARM_NAMES
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import (
    AsJson,
    Bearings,
    Order,
    ProfileName,
    ScenarioName,
    Side,
    build_scenario,
)
from scenarios.cli.shared.terminal import bar, show, show_json

if TYPE_CHECKING:
    from dim.proofs.modelcheck import Exploration
    from scenarios.scenario import Scenario

#: Beyond, there are too many states.
MAX_ARMS = 4


@app.command(
    epilog="Exit code 1 where the protocol is unsafe or gets stuck. 4 arms take 20 s, with "
    "--priorities rotating or waiting two minutes and a gigabyte.\n\n[bold]Examples[/bold]\n\n"
    "minisim protocol four-way --gate harmonious\n\n"
    "minisim protocol three-way --order lanes --priorities rotating\n\n"
    "minisim protocol four-way --commit paper --counterexample two.csv\n\n"
    "minisim animate four-way -c dim:commit=paper --arrivals two.csv --start 40 --seconds 15 "
    "-o two.gif"
)
def protocol(
    scenario: ScenarioName,
    commit: Annotated[
        str,
        typer.Option(
            metavar="stoppable|paper",
            help="When a vehicle is committed: it cannot stop any more, or it is past half of the "
            "green zone.",
        ),
    ] = "stoppable",
    gate: Annotated[
        str,
        typer.Option(
            metavar="clear|harmonious",
            help="Who may enter while others cross: nobody, or who is in harmony with them.",
        ),
    ] = "clear",
    order: Order = "size",
    priorities: Annotated[
        str,
        typer.Option(
            metavar="fixed|rotating|waiting",
            help="Which lane comes first where cliques tie: a, whose turn it is, or whose "
            "vehicle came first.",
        ),
    ] = "fixed",
    counterexample: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv", show_default=False,
            help="Where it is unsafe: write arrivals with which simulated vehicles collide.",
        ),
    ] = None,
    bearings: Bearings = None,
    side: Side = "left",
    profile: ProfileName = "paper",
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Visit every state of arrivals, decisions, commitments and clearings (3 and 4 arms).

    Is it safe, can it get stuck, who can wait for ever?
    """
    from dim import HarmonyMatrix
    from dim.proofs.modelcheck import explore, starvation
    from dim.proofs.protocol import Protocol
    from scenarios.cli.shared.files import check_file

    if counterexample is not None:
        choice("suffix of --counterexample:", counterexample.suffix.lower(), [".csv"])
        check_file(counterexample)
    what = build_scenario(scenario, bearings, profile=profile, side=side)
    matrix = HarmonyMatrix.from_geometry(what.intersection, what.profile.vehicle)
    if matrix.n > MAX_ARMS:
        raise InputError(
            f"the protocol is searched for 3 and 4 arms; {what.name} has {matrix.n}, and with "
            "them too many states"
        )
    rules = Protocol(matrix, order, gate, commit, priorities)
    with bar("visiting all states") as progress:
        found = explore(rules, progress=lambda states: progress(states, states))
        lassos = () if found.unsafe else starvation(rules)
    written = None
    if counterexample is not None:
        written = _write_counterexample(what, found, counterexample)
    if as_json:
        show_json({
            "scenario": what.name,
            "order": order,
            "gate": gate,
            "commit": commit,
            "priorities": priorities,
            "states": found.states,
            "transitions": found.transitions,
            "all_states": found.complete,
            "unsafe": [list(map(str, path)) for path in found.unsafe],
            "stuck": None if found.stuck is None else list(map(str, found.stuck)),
            "starving": {
                ARM_NAMES[k]: None if lasso is None else {
                    "stem": list(map(str, lasso.stem)), "cycle": list(map(str, lasso.cycle)),
                }
                for k, lasso in enumerate(lassos)
            },
        })  # fmt: skip
    else:
        from scenarios.cli.shared.proof import protocol_text

        show(protocol_text(what.name, found, lassos))
        if written is not None:
            typer.echo(f"wrote {written}")
    if found.unsafe or found.stuck is not None:
        raise typer.Exit(1)


def _write_counterexample(what: Scenario, found: Exploration, file: Path) -> Path:
    from dim import Dim
    from minisim.arrivals import write_arrivals
    from scenarios.counterexample import colliding_arrivals

    rules = found.protocol
    if rules.priorities != "fixed":
        raise InputError("--counterexample is for --priorities fixed")
    if not found.unsafe:
        raise InputError(f"there is no counterexample: commit {rules.commit} is safe")
    dim = Dim(order=rules.order, commit=rules.commit, gate=rules.gate)
    with bar("looking for a collision"):
        arrivals = colliding_arrivals(what, dim, found.unsafe)
    if arrivals is None:
        raise InputError("no simulated vehicles collide on the unsafe paths of the protocol")
    write_arrivals(arrivals, file)
    return file
