"""`minisim protocol`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from minisim.errors import InputError
from minisim.files import check_file
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.proof import answer, closed, junction, names, protocol_text
from scenarios.cli.shared.terminal import bar

if TYPE_CHECKING:
    from dim.proofs.modelcheck import Exploration
    from scenarios.scenario import Scenario

#: With more arms there are too many states; those of the gate "passed" also say which bars which.
MAX_ARMS, MAX_ARMS_PASSED = 4, 3


@app.command(
    epilog="Exit code 1 if the protocol is unsafe or gets stuck. 4 arms take 20 s; with "
    "--priorities rotating or waiting, two minutes and a gigabyte; with --gate passed, too many "
    "states.\n\n[bold]Examples[/bold]\n\n"
    "minisim protocol four-way --gate harmonious\n\n"
    "minisim protocol three-way --order lanes --priorities rotating\n\n"
    "minisim protocol four-way --commit paper --counterexample two.csv\n\n"
    "minisim animate four-way -c dim:commit=paper --arrivals two.csv --from 40 --seconds 15 "
    "-o two.gif"
)
def protocol(
    scenario: options.ScenarioName,
    commit: Annotated[
        str,
        typer.Option(
            metavar="stoppable|paper",
            help="A vehicle is committed once it cannot stop, or halfway through the green zone.",
        ),
    ] = "stoppable",
    gate: Annotated[
        str,
        typer.Option(
            metavar="clear|harmonious|passed",
            help="Which vehicles may enter while others cross: none, those in harmony, or "
            "also those in whose way none is any more.",
        ),
    ] = "clear",
    order: options.Order = "size",
    priorities: Annotated[
        str,
        typer.Option(
            metavar="fixed|rotating|waiting",
            help="Which lane comes first where cliques tie: lane a, the one whose turn it is, "
            "or the one whose vehicle came first.",
        ),
    ] = "fixed",
    counterexample: Annotated[
        Path | None,
        options.option("If it is unsafe: write arrivals that make simulated vehicles collide.",
                       "FILE.csv"),
    ] = None,
    bearings: options.Bearings = None,
    side: options.Side = None,
    node: options.Node = None,
    profile: options.ProfileName = "paper",
    as_json: options.AsJson = False,
) -> None:  # fmt: skip
    """Visit every state: is DIM safe, can it get stuck, which lanes starve? (3 and 4 arms)"""
    from dim.proofs.modelcheck import explore, starvation
    from dim.proofs.protocol import Protocol
    from minisim.junction.movements import ARM_NAMES

    if counterexample is not None:
        check_file(counterexample, ".csv")
    what, matrix = junction(scenario, bearings, side=side, node=node, profile=profile)
    rules = Protocol(matrix, order, gate, commit, priorities, closed(what))
    # Unsafe states are near: the search ends there with the paper's commit rule.
    places = gate == "passed" and commit != "paper"
    if matrix.n > (MAX_ARMS_PASSED if places else MAX_ARMS):
        only, known = (
            ("for 3 arms with the gate passed", "three-way, or another gate") if places
            else ("for 3 and 4 arms", "four-way")
        )  # fmt: skip
        raise InputError(
            f"the protocol is searched {only}; {what.name} has {matrix.n}, and too many states: "
            f"take {known}"
        )
    with bar("visiting all states") as progress:
        search = explore(rules, progress=lambda states: progress(states, states))
        lassos = () if search.unsafe else starvation(rules)
    if counterexample is not None:
        _write_counterexample(what, search, counterexample)
    facts = {
        "scenario": what.name, "order": order, "gate": gate, "commit": commit,
        "priorities": priorities, "states": search.states, "transitions": search.transitions,
        "all_states": search.complete,
        "unsafe": list(map(names, search.unsafe)),
        "stuck": None if search.stuck is None else names(search.stuck),
        "starving": {
            ARM_NAMES[k]: lasso and {"stem": names(lasso.stem), "cycle": names(lasso.cycle)}
            for k, lasso in enumerate(lassos)
        },
    }  # fmt: skip
    answer(as_json, facts, protocol_text(what.name, search, lassos), wrote=counterexample)
    if search.unsafe or search.stuck is not None:
        raise typer.Exit(1)


def _write_counterexample(what: Scenario, search: Exploration, file: Path) -> None:
    from dim import Dim
    from minisim.recorded import write_arrivals
    from scenarios.counterexample import colliding_arrivals

    rules = search.protocol
    if rules.priorities != "fixed":
        raise InputError("--counterexample is for --priorities fixed")
    if not search.unsafe:
        raise InputError(f"there is no counterexample: commit {rules.commit} is safe")
    dim = Dim(order=rules.order, commit=rules.commit, gate=rules.gate)
    with bar("looking for a collision"):
        arrivals = colliding_arrivals(what, dim, search.unsafe)
    if arrivals is None:
        raise InputError("no simulated vehicles collide on the unsafe paths of the protocol")
    write_arrivals(arrivals, file)
