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
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

from minisim.control import Controller, as_controller, cover_of
from minisim.errors import InputError, nearest, show
from minisim.spelling import Call, build, call_of, parse_arguments
from scenarios.loading import controllers_in, has_source, is_maker, load_class
from scenarios.profiles import AS_RUN, Profile, profile_named


class Look(NamedTuple):
    """How a series is drawn in every figure.

    No two controllers share a marker. Those whose colours look alike, to colour-blind readers too,
    differ in their dashes as well.
    """

    label: str
    colour: str  # its name in `figures.style.COLOURS`
    marker: str | tuple[int, Literal[1], int]  # as in matplotlib: a character, or a star
    dashes: Literal["-", "--", "-.", ":"]


class Variant(NamedTuple):
    """A controller with some of its parameters, as studies compare it."""

    arguments: str  # those that differ from the defaults, as written in a spec
    look: Look  # in figures
    rival: bool = False  # whether it is compared with all others on equal terms


#: What a controller needs; figures of many controllers have a row of panels for each.
BARE, SIGNALS, RADIO = "neither signals nor messages", "signals", "messages by radio"


class Entry(NamedTuple):
    """A row of the table of controllers."""

    name: str  # without parameters
    where: str  # module and class, which is loaded on use
    needs: str  # one of `BARE`, `SIGNALS`, `RADIO`
    variants: tuple[Variant, ...]  # those that have a look
    as_run: str = ""  # what the bare name means under the profile `as_run`, if different

    @property
    def make(self) -> type[Any]:
        """Declares the parameters; its docstring's first line is the help text."""
        module, _, name = self.where.partition(":")
        return getattr(import_module(module), name)  # type: ignore[no-any-return]


def _plain(*look: Any, rival: bool = True) -> tuple[Variant]:
    return (Variant("", Look(*look), rival),)


#: Our controllers, the paper's four first; figures show rivals in this order.
CONTROLLERS: Mapping[str, Entry] = MappingProxyType({
    entry.name: entry
    for entry in (
        Entry("dim", "dim:Dim", BARE, (
            Variant("", Look("DIM", "blue", "o", "-"), rival=True),
            Variant("gate=harmonious", Look("DIM, harmonious gate", "sky", "p", "-"), rival=True),
            Variant("gate=passed", Look("DIM, gate passed", "indigo", ">", "--"), rival=True),
            Variant("order=lanes", Look("DIM, lanes first", "green", (3, 1, 180), "--")),
            Variant("priorities=rotating", Look("DIM, rotating priority", "orange", "8", "-.")),
            Variant("priorities=waiting",
                    Look("DIM, longest-waiting priority", "green", (3, 1, 0), ":")),
            Variant("order=lanes,priorities=waiting",
                    Look("DIM, lanes first by waiting", "indigo", (4, 1, 45), "-.")),
            Variant("monitor=on", Look("DIM with safety monitor", "blue", "H", "-.")),
        ), as_run="dim-as-run"),
        Entry("fixed-time", "baselines:FixedTime", SIGNALS, (
            Variant("", Look("fixed-time signal", "vermillion", "s", "--"), rival=True),
            Variant("facing=true", Look("two-phase signal", "vermillion", "d", ":"), rival=True),
        )),
        Entry("adaptive", "baselines:Adaptive", SIGNALS,
              _plain("adaptive signal", "orange", "^", "-")),
        Entry("v2ic", "baselines:V2IC", RADIO,
              _plain("V2I-C", "green", "D", "-."), as_run="v2ic-as-run"),
        Entry("all-way-stop", "baselines:AllWayStop", BARE,
              _plain("all-way stop", "ink", "X", "--")),
        Entry("reservation", "baselines:Reservation", RADIO,
              _plain("reservation", "purple", "<", "-")),
        Entry("max-pressure", "baselines:MaxPressure", SIGNALS, (
            Variant("", Look("max-pressure", "brown", "v", "-"), rival=True),
            Variant("facing=true", Look("two-phase max-pressure", "brown", "h", "--"), rival=True),
        )),
        Entry("slots", "baselines:Slots", RADIO, (
            Variant("", Look("slots for batches", "ink", "P", "-"), rival=True),
            Variant("batch=1", Look("slots, first come first served", "ink", "x", ":"), rival=True),
        )),
        Entry("platoons", "baselines:Platoons", RADIO, (
            Variant("", Look("platoons, exhaustive", "indigo", "*", "-"), rival=True),
            Variant("service=gated",
                    Look("platoons, gated", "indigo", (4, 1, 0), ":"), rival=True),
        )),
        Entry("actuated", "baselines:Actuated", SIGNALS,
              _plain("actuated signal", "brown", "$a$", ":", rival=False)),
        Entry("dim-as-run", "dim:AsRunDim", BARE,
              _plain("DIM as run", "blue", "$d$", "--", rival=False)),
        Entry("v2ic-as-run", "baselines:V2ICAsRun", RADIO,
              _plain("V2I-C as run", "ink", "$v$", "-.", rival=False)),
        Entry("unregulated", "minisim.control:Unregulated", BARE,
              _plain("unregulated", "brown", "$u$", "-.", rival=False)),
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

#: The same by what they need.
FAMILIES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        needs: tuple(name for name in RIVALS if CONTROLLERS[name.partition(":")[0]].needs == needs)
        for needs in (BARE, SIGNALS, RADIO)
    }
)


@cache
def safe() -> tuple[str, ...]:
    """Spellings of the variants that never collide and that serve any number of arms."""
    made = {name: entry.make for name, entry in CONTROLLERS.items()}
    return tuple(name for name in VARIANTS if cover_of(made[name.partition(":")[0]]).laws)


#: A class of a caller's own: module or file, class, arguments.
_CLASS = re.compile(r"(.+?):([A-Za-z_]\w*)(?:\((.*)\))?", re.DOTALL)

#: The same with a slip: a dot for the colon, no brackets, or one missing.
_ALMOST = re.compile(r"([\w./-]+)[:.]([A-Z]\w*)(|\W.*)", re.DOTALL)

#: What is allowed besides the known names.
OWN = "a class of your own, such as mymodule:MyController(k=3)"


def controller_named(
    spec: str | Mapping[str, Any] | Controller, profile: str | Profile = "paper"
) -> Controller:
    """The controller that a string or table names; a controller is returned as it is.

    Under the profile `as_run`, a bare "dim" or "v2ic" means what was run for the paper. Raises
    `InputError` for an unknown name or parameter (with the nearest one), a value that is not
    allowed, a class that cannot be loaded or made, or one that is not a controller.
    """
    as_run = profile_named(profile).name == AS_RUN.name
    if not isinstance(spec, str | Mapping):
        return as_controller(spec)
    call = read_spec(spec)
    name = call.name
    if as_run and not call.named and name in CONTROLLERS:
        name = CONTROLLERS[name].as_run or name
    return as_controller(build(name, maker_of(name), call), call.name)


def label_of(series: str) -> str:
    """What figures and reports call a variant; the name itself if it has no look."""
    return VARIANTS[series].look.label if series in VARIANTS else series


def read_spec(spec: str | Mapping[str, Any]) -> Call:
    """Split a controller's text or table into its name and arguments; raises `InputError`."""
    if isinstance(spec, Mapping):
        table = call_of(spec)
        read = read_spec(table.name)
        return Call(read.name, read.places, {**read.named, **table.named})
    head, colon, rest = spec.partition(":")
    known = head in CONTROLLERS or head in plugins()
    written = _CLASS.fullmatch(spec)
    if written is not None and (not known or rest[:1].isupper()):
        module, kind, arguments = written.groups()
        return parse_arguments(f"{module}:{kind}", arguments or "")
    if not known:
        raise _unknown(spec, head)
    if not colon:
        return Call(spec)
    call = parse_arguments(head, rest)
    if call.places or not call.named:
        raise InputError(f"parameters are written {head}:key=value,key=value, got {show(spec)}")
    return call


def _unknown(text: str, head: str) -> InputError:
    """What is wrong with a text that names no controller, and what may be meant."""
    known = [*CONTROLLERS, *plugins()]
    name = re.split(r"[^\w-]", text, maxsplit=1)[0]
    module = text.rstrip(":")
    if name.casefold() in known and name != text:
        hints = [f"{name.casefold()}:{_bare(text.removeprefix(name))}".rstrip(":")]
    elif almost := _ALMOST.fullmatch(text):
        hints = [f"{almost[1]}:{almost[2]}({_bare(almost[3])})".removesuffix("()")]
    elif module and has_source(module):
        hints = [f"{module}:{kind}" for kind in controllers_in(module)]
    else:
        return InputError(
            f"unknown controller {show(head)}; allowed: {', '.join(known)}, or {OWN}"
            f"{nearest(head, known)}"
        )
    question = f"; did you mean {' or '.join(map(repr, hints))}?" if hints else ""
    return InputError(
        f"cannot read controller {show(text)}; it is written name, name:key=value,key=value or as "
        f"{OWN}{question}"
    )


def _bare(arguments: str) -> str:
    """Arguments without the signs around them."""
    bare = arguments.lstrip(" :.,(").rstrip(" ,")
    return bare[:-1] if bare.count(")") > bare.count("(") else bare


def maker_of(name: str) -> Any:
    """The class (or plugin's function) for a name or `module:Class`; raises `InputError`."""
    if name in CONTROLLERS:
        return CONTROLLERS[name].make
    make = _loaded(name) if name in plugins() else load_class(*name.rsplit(":", 1))
    if isinstance(make, type) and not is_maker(make):
        as_controller(make, name)  # says what it lacks
    return make


def _loaded(name: str) -> Any:
    plugin = plugins()[name]
    try:
        return plugin.load()
    except (Exception, SystemExit) as error:  # another author's code may raise anything
        raise InputError(
            f"controller {name} of package {package_of(plugin)} cannot be loaded: "
            f"{type(error).__name__}: {error}"
        ) from error


@cache
def plugins() -> Mapping[str, EntryPoint]:
    """The controllers that installed packages register, by name; see `unused_plugins`."""
    found: dict[str, EntryPoint] = {}
    for point in entry_points(group="minisim.controllers"):
        if point.name not in CONTROLLERS:
            found.setdefault(point.name, point)
    return found


def unused_plugins() -> dict[str, str]:
    """Registered controllers whose name was taken before -> why they are not used."""
    unused = {}
    for point in entry_points(group="minisim.controllers"):
        used = plugins().get(point.name)
        if used is None or used != point:
            owner = package_of(used) if used else "minisim"
            why = f"not used: {owner} has a controller of that name"
            unused[f"{point.name} of {package_of(point)}"] = why
    return unused


def package_of(plugin: EntryPoint) -> str:
    """The package that registers a controller."""
    return plugin.dist.name if plugin.dist is not None else plugin.module
