"""What the host calls: a `Controller` for each run, its `Session` at each wake-up."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Any, Protocol, TypeGuard, TypeVar, runtime_checkable

from minisim.control.commands import Command
from minisim.control.plan import Plan
from minisim.control.site import Site
from minisim.control.view import View
from minisim.errors import InputError, printable, show, told

_P = TypeVar("_P")


def keeps(value: object, protocol: Callable[..., _P]) -> TypeGuard[_P]:
    """Whether a value has all that a protocol asks: `isinstance`, but faster."""
    methods, others = _members(protocol)
    return all(getattr(value, name, None) is not None for name in methods) and all(
        hasattr(value, name) for name in others
    )


@cache
def _members(protocol: Any) -> tuple[list[str], list[str]]:
    """The methods of a protocol and its other members, with those of its parents."""
    kinds = [kind for kind in protocol.__mro__ if Protocol in kind.__bases__]
    each = {name: it for kind in kinds for name, it in vars(kind).items() if name[0] != "_"}
    methods = [name for name, it in each.items() if callable(it)]
    return methods, [name for name in each if name not in methods]


@runtime_checkable
class Session(Protocol):
    """One run's side of a controller: it may remember things."""

    @property
    def plan(self) -> Plan:
        """What it needs from its host; read once, after `start`."""

    def decide(self, view: View) -> Iterable[Command]:
        """Answer a view with commands; all are collected before any is carried out.

        Called once at time 0, then at every wake-up.
        """


@runtime_checkable
class Counting(Session, Protocol):
    """A session that counts something for the summary of its run."""

    @property
    def counts(self) -> Mapping[str, float]:
        """Name -> count so far, which only grows; no name may clash with a summary's own."""


@runtime_checkable
class Kinds(Session, Protocol):
    """A session whose vehicles are of several kinds, by which summaries group them."""

    def kind(self, lane: int, rank: int) -> str:
        """Kind of a vehicle, such as "human", by its lane and its place there."""


@runtime_checkable
class Controller(Protocol):
    """A recipe for sessions: hashable, picklable, never changed by a run.

    It promises that no `ORDINARY` vehicles collide and that each is served. A controller that
    promises less or more has an attribute `covers`, a `Cover`. One that vehicles talk to has an
    attribute `radio`, a `Radio`; without it, nothing is sent. One that shows lights, but need not
    open lanes, has an attribute `lights` of True, so that its junction counts as signalised.
    """

    @property
    def name(self) -> str:
        """What rows, figures and messages call it."""

    def start(self, site: Site) -> Session:
        """Begin a run. Raises `InputError` for a site that it cannot serve."""


def as_controller(value: object, what: str = "") -> Controller:
    """Return `value` if it is a controller; an `InputError` calls it `what`, or shows it."""
    try:
        if keeps(value, Controller) and not isinstance(value, type):
            name = value.name
            if not (type(name) is str and name and name.isprintable()):  # to show it takes long
                printable(f"the name of {what or show(value)}", name)
            return value
    except InputError:
        raise
    except (Exception, SystemExit) as error:  # a caller's code may raise anything
        raise InputError(f"{what or show(value)} has no name: {told(error)}") from error
    lacks = [part for part in ("name", "start") if not hasattr(value, part)]
    why = f"it has no {' and no '.join(lacks)}" if lacks else "it is a class"
    named = isinstance(value, str | Mapping)
    hint = "; make it with scenarios.controllers.controller_named" if named else ""
    raise InputError(f"{what or show(value)} is not a controller: {why}{hint}")
