"""Questions and their answers. Each study is one module: its runs, and what it computes from them.

A module exports its `STUDY`; the module of the same name in `figures.studies` draws it. What
several need is in `shared`. Lists, help texts and the report have the studies of `NAMES`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from minisim.errors import choice

if TYPE_CHECKING:
    from scenarios.studies.shared.study import Study

#: Every study, in the order of runs and of the report.
NAMES = (
    "text", "as-run", "fair", "optimum", "gap", "gate", "mixed", "capacity", "fairness",
    "humans", "perception", "confidence", "messages",
)  # fmt: skip

#: Studies that choose runs by the results of earlier ones, so they cannot be listed in advance.
SEARCHES = ("capacity",)


def study_named(name: str) -> Study:
    """A study by name; `InputError` names the nearest one."""
    choice("study", name, NAMES)
    study: Study = import_module(f"scenarios.studies.{module_name(name)}").STUDY
    return study


def module_name(study: str) -> str:
    """The name of a study's modules, here and in `figures.studies`."""
    return study.replace("-", "_")
