"""Packages whose names are loaded on first use, so that importing one of them is quick."""

import importlib

# Not typing's: `python -m minisim` imports this early, and may find a typing.py (or __future__.py)
# in the working directory. Type checkers know the name.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


def loader(package: str, modules: "Mapping[str, str]") -> "Callable[[str], object]":
    """The `__getattr__` of a package; `modules` lists its names, separated by spaces, by module."""
    places = {name: module for module, names in modules.items() for name in names.split()}

    def load(name: str) -> object:
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(importlib.import_module(places[name]), name)

    return load
