"""`minisim metrics`."""

from __future__ import annotations

from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.terminal import show, show_json

#: What is printed about a metric.
SAID = ("name", "unit", "title", "symbol", "per", "needs", "meaning", "equation", "usual")


@app.command(
    epilog="Means are over the trips that ended before the horizon, as SUMO and the paper count "
    "them; complete means also count the others, up to the horizon.\n\n"
    "[bold]Examples[/bold]\n\n"
    "minisim metrics --json\n\n"
    "minisim run four-way --metrics waiting_time_s,max_drac_mps2 --by movement"
)
def metrics(as_json: options.AsJson = False) -> None:
    """List what is measured: names, units, meanings and equations."""
    from minisim.results.metrics import TABLE
    from scenarios.cli.shared.report import metrics_table

    if as_json:
        show_json([{key: getattr(metric, key) for key in SAID} for metric in TABLE])
    else:
        show(metrics_table(TABLE))
