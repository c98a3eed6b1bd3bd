"""`minisim controllers`."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any

import typer

from minisim.errors import InputError, show
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.terminal import show_json, wrapped


@app.command(
    epilog="Give parameters as in -c dim:gate=harmonious,monitor=on. A controller of your own "
    "needs no registration: -c 'mymodule:MyController(k=3)' or -c path/to/file.py:MyController.\n\n"
    "[bold]Examples[/bold]\n\nminisim controllers dim\n\nminisim controllers mymodule:MyController"
)
def controllers(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="List its parameters.")] = None,
    as_json: options.AsJson = False,
) -> None:
    """List the controllers, or the parameters of one."""
    from minisim.control import ORDINARY, cover_of
    from scenarios.controllers import controller_named, maker_of, read_spec

    if name is None:
        meanings = _meanings()
        if as_json:
            show_json(meanings)
            return
        width = min(max(map(len, meanings)), 24) + 2
        for known, meaning in meanings.items():
            typer.echo(wrapped(f"{known:{width}}{meaning}", width))
        return
    call = read_spec(name)
    make = maker_of(call.name)
    made = controller_named(name) if call.places or call.named else None
    meaning, parameters, covers = _meaning(make), list(_parameters(make, made)), cover_of(make)
    if as_json:
        facts = {"meaning": meaning, "covers": str(covers), "parameters": parameters}
        show_json({"name": name, **facts})
        return
    typer.echo(wrapped(f"{name}: {meaning}", 0))
    if covers != ORDINARY:
        typer.echo(wrapped(f"No vehicle collides, and each is served: {covers}.", 0))
    _show_parameters(parameters)
    for parameter in parameters:
        for word, kind in parameter["kinds"].items():
            if kind["parameters"]:
                typer.echo("\n" + wrapped(f"{parameter['name']}={word}(…): {kind['meaning']}", 0))
                _show_parameters(kind["parameters"])


def _meanings() -> dict[str, str]:
    """One line for every controller, and for each unusable name that a package registers."""
    from scenarios.controllers import CONTROLLERS, maker_of, package_of, plugins, unused_plugins

    meanings = {known: _meaning(entry.make) for known, entry in CONTROLLERS.items()}
    for known, plugin in plugins().items():
        try:
            meanings[known] = f"{_meaning(maker_of(known))} (package {package_of(plugin)})".strip()
        except InputError as error:
            meanings[known] = str(error)
    return meanings | unused_plugins()


def _meaning(make: Callable[..., Any]) -> str:
    return (inspect.getdoc(make) or "").partition("\n")[0]


def _parameters(make: Callable[..., Any], made: object) -> Iterator[dict[str, Any]]:
    """What is declared of each parameter, or else its signature; values are those of `made`."""
    from minisim.parameters import parameters

    declared = {it.name: it.parameter for it in parameters(make)}
    for name, given in inspect.signature(make).parameters.items():
        it = declared.get(name)
        kinds: Mapping[str, Callable[..., Any]] = it.kinds if it else {}
        typed = given.annotation is not given.empty
        hint = inspect.formatannotation(given.annotation).strip("'") if typed else ""
        value = getattr(made, name, given.default)
        yield {
            "name": name,
            "default": _spelled(given.default, kinds),
            "value": _spelled(value, kinds),
            "allowed": it.allowed if it else hint,
            "unit": it.unit if it else "",
            "meaning": it.meaning if it else "",
            "kinds": {
                word: {
                    "meaning": _meaning(kind),
                    "parameters": list(_parameters(kind, value if type(value) is kind else None)),
                }
                for word, kind in kinds.items()
            },
        }  # fmt: skip


def _spelled(value: Any, kinds: Mapping[str, Callable[..., Any]]) -> str | None:
    """A value as typed, or its repr if that is impossible; None if there is none."""
    from minisim.names import spelled_value

    if value is inspect.Parameter.empty:
        return None
    text = spelled_value(value, kinds)
    return show(value) if "#" in text and not isinstance(value, str) else text


def _show_parameters(parameters: list[dict[str, Any]]) -> None:
    for it in parameters:
        value = "" if it["value"] is None else f"={it['value']}"
        unit = f" [{it['unit']}]" if it["unit"] else ""
        allowed = f"  ({it['allowed']})" if it["allowed"] else ""
        typer.echo("\n" + wrapped(f"  {it['name']}{value}{unit}{allowed}", 6))
        if it["meaning"]:
            typer.echo(wrapped(f"{'':6}{it['meaning']}", 6))
