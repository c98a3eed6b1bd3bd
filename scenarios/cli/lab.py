"""`minisim lab`."""

from __future__ import annotations

from typing import Annotated

import typer

from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import option


@app.command(
    epilog="The page is for this computer only, and its address is a secret of yours. The part "
    "after # holds the setting: send that, and it shows the same run in another lab.\n\n"
    "minisim lab 'controller=dim&gate=harmonious&density=300&beside=fixed-time'"
)
def lab(
    setting: Annotated[
        str,
        typer.Argument(metavar="[SETTING]", help="To begin with: what follows # in an address."),
    ] = "",
    port: Annotated[int, option("Of the page; any free one by default.", "N")] = 0,
    open_it: Annotated[bool, option("Open it in a browser.", None, "--open")] = False,
) -> None:
    """A page with sliders: the junction simulated as you move them, until Ctrl-C."""
    from minisim.errors import integer
    from scenarios.lab import Setting

    begun = Setting.read(setting.rpartition("#")[2])
    integer("--port", port, low=0, high=65535)
    from figures.player.lab import LabServer

    with LabServer(port) as server:
        address = f"{server.address}#{begun}" if str(begun) else server.address
        try:
            typer.echo(f"The lab is at {address}\nCtrl-C stops it.")
            if open_it:
                import webbrowser

                webbrowser.open(address)
            server.serve_forever()
        except KeyboardInterrupt:
            typer.echo("stopped")
