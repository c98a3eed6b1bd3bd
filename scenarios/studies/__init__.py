"""Questions and their answers, one module a study: which runs, and what their rows say.

A module exports its `STUDY`; the module of the same name in `figures.studies` draws it. What they
share is in `shared`. A new study is named in `NAMES`: lists, help texts and the report follow it.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from minisim.errors import choice

if TYPE_CHECKING:
    from scenarios.studies.shared.study import Study

#: Every study, in the order in which they are run and reported.
NAMES = (
    "text", "as-run", "fair", "gate", "capacity", "fairness", "humans", "perception", "confidence",
)  # fmt: skip

#: Those that choose experiments by the results of others, and so have no list of them.
SEARCHES = ("capacity",)


def study_named(name: str) -> Study:
    """A study by name; raises `InputError` with the nearest one."""
    choice("study", name, NAMES)
    study: Study = import_module(f"scenarios.studies.{module_name(name)}").STUDY
    return study


def module_name(study: str) -> str:
    """What the modules of a study are called, here and in `figures.studies`."""
    return study.replace("-", "_")
