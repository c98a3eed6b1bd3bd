"""`minisim metrics`."""

from __future__ import annotations

import typer

from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.terminal import show_json, wrapped

#: What is printed about each metric.
SAID = ("name", "unit", "title", "symbol", "per", "needs", "meaning", "equation", "usual")


@app.command(
    epilog="Means are over the trips that ended before the horizon, as SUMO and the paper count "
    "them; complete means also count the others, up to the horizon. Nothing before the end of "
    "--warmup is measured; only collisions always count. mymodule:name is a metric of your own.\n\n"
    "[bold]Examples[/bold]\n\n"
    "minisim metrics --json\n\n"
    "minisim run four-way --metrics waiting_time_s,max_drac_mps2 --by movement"
)
def metrics(as_json: options.AsJson = False) -> None:
    """List what is measured: names, units, meanings and equations."""
    from minisim.results.metrics import TABLE

    if as_json:
        show_json([{key: getattr(metric, key) for key in SAID} for metric in TABLE])
        return
    for it in TABLE:
        unit = f" [{it.unit}]" if it.unit else ""
        typer.echo(f"{it.name}{unit}, one per {it.per}, from the {it.needs}")
        equation = " = ".join(filter(None, (it.symbol, it.equation)))
        typer.echo(wrapped("; ".join(filter(None, (f"    {it.meaning}", equation))), 4))
