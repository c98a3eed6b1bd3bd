"""What is simulated: scenarios and profiles; also sweeps, studies and the command line.

The names below are loaded when they are first used, so `minisim --help` is quick.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.library import (
        five_way,
        four_way,
        from_bearings,
        from_file,
        regular,
        three_way,
    )
    from scenarios.profiles import AS_RUN, FAIR, PAPER, PROFILES, Profile
    from scenarios.scenario import Scenario

__all__ = [
    "AS_RUN",
    "FAIR",
    "PAPER",
    "PROFILES",
    "Profile",
    "Scenario",
    "five_way",
    "four_way",
    "from_bearings",
    "from_file",
    "regular",
    "three_way",
]


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'scenarios' has no attribute {name!r}")
    home = "library" if name.islower() else "scenario" if name == "Scenario" else "profiles"
    return getattr(importlib.import_module(f"scenarios.{home}"), name)
