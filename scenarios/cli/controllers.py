"""`minisim controllers`."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any

import typer

from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.terminal import show_json, wrapped


@app.command(
    epilog="Give parameters as in -c dim:gate=harmonious,monitor=on. A controller of your own "
    "needs no registration: -c mymodule:MyController(k=3) or -c path/to/file.py:MyController.\n\n"
    "[bold]Examples[/bold]\n\nminisim controllers dim\n\nminisim controllers mymodule:MyController"
)
def controllers(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="List the parameters of this one.")
    ] = None,
    as_json: options.AsJson = False,
) -> None:
    """List the controllers, or the parameters of one."""
    from minisim.control import cover_of
    from scenarios.controllers import CONTROLLERS, maker_of, package_of, plugins

    if name is None:
        meanings = {known: _meaning(entry.make) for known, entry in CONTROLLERS.items()}
        for known, plugin in plugins().items():
            meanings[known] = f"of the package {package_of(plugin)} ({plugin.value})"
        if as_json:
            show_json(meanings)
            return
        width = max(map(len, meanings)) + 2
        for known, meaning in meanings.items():
            typer.echo(wrapped(f"{known:{width}}{meaning}", width))
        return
    ours = name.partition(":")[0]
    make = maker_of(ours if ours in CONTROLLERS else name)
    meaning, parameters, covers = _meaning(make), list(_parameters(make)), str(cover_of(make))
    if as_json:
        show_json({"name": name, "meaning": meaning, "covers": covers, "parameters": parameters})
        return
    typer.echo(wrapped(f"{name}: {meaning}", 0))
    typer.echo(wrapped(f"None collides, and each is served: {covers}.", 0))
    _show_parameters(parameters)
    for parameter in parameters:
        for word, kind in parameter["kinds"].items():
            if kind["parameters"]:
                typer.echo("\n" + wrapped(f"{parameter['name']}={word}: {kind['meaning']}", 0))
                _show_parameters(kind["parameters"])


def _meaning(make: Callable[..., Any]) -> str:
    return (inspect.getdoc(make) or "").partition("\n")[0]


def _parameters(make: Callable[..., Any]) -> Iterator[dict[str, Any]]:
    """What is declared about each parameter, or else what its signature says."""
    from minisim.parameters import parameters, spelled_value

    declared = {it.name: it.parameter for it in parameters(make)}
    for name, given in inspect.signature(make).parameters.items():
        it = declared.get(name)
        kinds: Mapping[str, Callable[..., Any]] = it.kinds if it else {}
        empty, hint = given.empty, ""
        if given.annotation is not empty:
            hint = inspect.formatannotation(given.annotation).strip("'")
        yield {
            "name": name,
            "default": None if given.default is empty else spelled_value(given.default, kinds),
            "allowed": it.allowed if it else hint,
            "unit": it.unit if it else "",
            "meaning": it.meaning if it else "",
            "kinds": {
                word: {"meaning": _meaning(kind), "parameters": list(_parameters(kind))}
                for word, kind in kinds.items()
            },
        }  # fmt: skip


def _show_parameters(parameters: list[dict[str, Any]]) -> None:
    for it in parameters:
        default = "" if it["default"] is None else f"={it['default']}"
        unit = f" [{it['unit']}]" if it["unit"] else ""
        allowed = f"  ({it['allowed']})" if it["allowed"] else ""
        typer.echo(f"\n  {it['name']}{default}{unit}{allowed}")
        if it["meaning"]:
            typer.echo(wrapped(f"      {it['meaning']}", 6))
