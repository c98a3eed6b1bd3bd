"""The table of controllers, and how to name one.

A controller is named the same way on the command line, in files and in Python:

    dim                                        its defaults
    dim:gate=harmonious,monitor=on             parameters, see `minisim controllers dim`
    mymodule:MyController(k=3)                 a class of your own, from the working directory or
    path/to/file.py:MyController(k=3)          installed
    {name = "dim", gate = "harmonious"}        a table, as in TOML

An installed package may add names through entry points of the group `minisim.controllers`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

from baselines import (
    V2IC,
    Actuated,
    Adaptive,
    AllWayStop,
    FixedTime,
    LongestQueue,
    Reservation,
    V2ICAsRun,
)
from dim import AsRunDim, Dim
from minisim.control import Controller, Unregulated
from minisim.errors import InputError, choice, show
from scenarios.loading import load_class
from scenarios.profiles import AS_RUN, Profile, profile_named
from scenarios.spelling import Call, build, call_of, parse_arguments


class Look(NamedTuple):
    """How a series is drawn in every figure; any two looks also differ in greyscale."""

    label: str
    colour: str  # its name in `figures.style.COLOURS`
    marker: str
    dashes: Literal["-", "--", "-.", ":"]


class Variant(NamedTuple):
    """A controller with some of its parameters, as studies compare it.

    Attributes:
        arguments: those that differ from the defaults, as written in a spec.
        look: its look in figures; None means grey.
        rival: whether it is compared with all others on equal terms.
    """

    arguments: str = ""
    look: Look | None = None
    rival: bool = False


class Entry(NamedTuple):
    """A row of the table of controllers.

    Attributes:
        name: the controller's name, without parameters.
        make: its class, which declares the parameters; its docstring's first line is the help text.
        variants: those that have a look or are rivals.
        safe: whether these variants never collide, with any number of arms.
        as_run: what the bare name means under the profile `as_run`; empty means the same as usual.
    """

    name: str
    make: type[Any]
    variants: tuple[Variant, ...] = (Variant(),)
    safe: bool = True
    as_run: str = ""


#: Our controllers, the paper's four first; figures show rivals in this order.
CONTROLLERS: Mapping[str, Entry] = MappingProxyType({
    entry.name: entry
    for entry in (
        Entry("dim", Dim, (
            Variant("", Look("DIM", "blue", "o", "-"), rival=True),
            Variant("gate=harmonious", Look("DIM, harmonious gate", "sky", "p", "-"), rival=True),
            Variant("order=lanes", Look("DIM, lanes first", "green", ">", "--")),
            Variant("priorities=rotating", Look("DIM, rotating priority", "vermillion", "P", "--")),
            Variant("priorities=waiting", Look("DIM, longest-waiting priority", "green", "*", ":")),
            Variant("order=lanes,priorities=waiting"),
            Variant("monitor=on", Look("DIM with safety monitor", "purple", "H", "-.")),
        ), as_run="dim-as-run"),
        Entry("fixed-time", FixedTime, (
            Variant("", Look("fixed-time signal", "vermillion", "s", "--"), rival=True),
        )),
        Entry("adaptive", Adaptive, (
            Variant("", Look("adaptive signal", "orange", "^", "-."), rival=True),
        )),
        Entry("v2ic", V2IC, (
            Variant("", Look("V2I-C", "green", "D", ":"), rival=True),
        ), as_run="v2ic-as-run"),
        Entry("all-way-stop", AllWayStop, (
            Variant("", Look("all-way stop", "ink", "X", "--"), rival=True),
        )),
        Entry("reservation", Reservation, (
            Variant("", Look("reservation", "purple", "v", "-."), rival=True),
        )),
        Entry("longest-queue", LongestQueue, (
            Variant("", Look("longest queue first", "brown", "<", ":"), rival=True),
        )),
        Entry("actuated", Actuated),
        Entry("dim-as-run", AsRunDim, safe=False),
        Entry("v2ic-as-run", V2ICAsRun, safe=False),
        Entry("unregulated", Unregulated, safe=False),
    )
})  # fmt: skip

#: Every variant, by its spelling.
VARIANTS: Mapping[str, Variant] = MappingProxyType({
    f"{name}:{variant.arguments}" if variant.arguments else name: variant
    for name, entry in CONTROLLERS.items()
    for variant in entry.variants
})  # fmt: skip

#: Spellings of the variants compared on equal terms, in the order used in figures.
RIVALS = tuple(name for name, variant in VARIANTS.items() if variant.rival)

#: Spellings of the variants that never collide and that serve any number of arms.
SAFE = tuple(name for name in VARIANTS if CONTROLLERS[name.partition(":")[0]].safe)

_CLASS = re.compile(r"(.+?):([A-Za-z_]\w*)(?:\((.*)\))?", re.DOTALL)


def controller_named(
    spec: str | Mapping[str, Any] | Controller, profile: str | Profile = "paper"
) -> Controller:
    """The controller that a string or table names; a controller is returned as it is.

    Args:
        spec: see the module's docstring.
        profile: under `as_run`, a bare "dim" or "v2ic" means what was run for the paper.

    Raises:
        InputError: an unknown name or parameter (with the nearest one), a value that is not
            allowed, a class that cannot be loaded or made, or one that is not a controller.
    """
    as_run = profile_named(profile).name == AS_RUN.name
    if isinstance(spec, str):
        call, text = _read(spec), spec
    elif isinstance(spec, Mapping):
        table = call_of(spec)
        read, text = _read(table.name), table.name
        call = Call(read.name, read.places, {**read.named, **table.named})
    else:
        return check_controller(show(spec), spec)
    name = call.name
    if as_run and not call.named and name in CONTROLLERS:
        name = CONTROLLERS[name].as_run or name
    return check_controller(text, build(name, maker_of(name), call))


def check_controller(what: str, value: Any) -> Controller:
    """Return `value` if it is a controller; otherwise raise `InputError` saying what it lacks."""
    if isinstance(value, Controller) and not isinstance(value, type):
        return value
    lacks = [part for part in ("name", "start") if not hasattr(value, part)]
    why = f"it has no {' and no '.join(lacks)}" if lacks else "it is a class"
    raise InputError(f"{what} is no controller: {why}")


def maker_of(name: str) -> Any:
    """The class (or plugin's function) for a name or `module:Class`; raises `InputError`."""
    if name in CONTROLLERS:
        return CONTROLLERS[name].make
    if written := _CLASS.fullmatch(name):
        return load_class(written[1], written[2])
    plugin = plugins()[choice("controller", name, [*CONTROLLERS, *plugins()])]
    try:
        return plugin.load()
    except (Exception, SystemExit) as error:  # another author's code may raise anything
        raise InputError(
            f"controller {name} of package {package_of(plugin)} cannot be loaded: "
            f"{type(error).__name__}: {error}"
        ) from error


@cache
def plugins() -> Mapping[str, EntryPoint]:
    """The controllers that installed packages register, by name; our own names take precedence."""
    points = entry_points(group="minisim.controllers")
    return {point.name: point for point in points if point.name not in CONTROLLERS}


def package_of(plugin: EntryPoint) -> str:
    """The package that registers a controller."""
    return plugin.dist.name if plugin.dist is not None else plugin.module


def _read(text: str) -> Call:
    """Split a controller's text into its name and arguments."""
    head, colon, rest = text.partition(":")
    written = _CLASS.fullmatch(text)
    if written is not None and (head not in CONTROLLERS or rest[:1].isupper()):
        module, kind, arguments = written.groups()
        return parse_arguments(f"{module}:{kind}", arguments or "")
    if not colon:
        return Call(text)
    choice("controller", head, [*CONTROLLERS, *plugins()])
    call = parse_arguments(head, rest)
    if call.places or not call.named:
        raise InputError(
            f"parameters of {head} are written {head}:key=value,key=value, got {show(text)}"
        )
    return call
