"""Safety measures of a recording: TTC, DRAC, PET and braking, as SUMO's SSM device defines them.

They are functions of a trajectory frame (`run.trajectories`; record="junction" will do) and a site,
or of the encounters in a run (`minisim.results.encounters`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from minisim.control import Site
from minisim.junction.paths import Floats
from minisim.results.encounters import Encounters, encounters_in
from minisim.results.metrics import PETS

if TYPE_CHECKING:
    import pandas as pd

    from minisim.results.run import Run

#: An encounter is critical below these [s] (van der Horst 1990, A time-based analysis of road user
#: behaviour in normal and critical encounters), or above this [m/s²] (what is comfortable, as in
#: `minisim.results.driving`; Archer 2005, Indicators for traffic safety assessment, has 3.35).
SHORT_TTC, SHORT_PET, HIGH_DRAC = 1.5, 1.0, 3.4


def safety_summary(frame: pd.DataFrame, site: Site) -> dict[str, float | int | None]:
    """The closest calls in a recording; None if nothing of the kind happened.

    `min_ttc_s` is of following and crossing, `max_drac_mps2` of following; `pets` counts all
    encroachments, others the short ones (`minisim.results.metrics.PETS`). Raises `InputError` for
    a missing column, or a movement that the site does not have.
    """
    return summary_of(encounters_in(frame, site))


def summary_of(found: Encounters) -> dict[str, float | int | None]:
    """The closest calls among encounters, see `safety_summary`."""
    follow, pets = found.follow, found.encroach["pet_s"]
    ttc = np.concatenate([follow["ttc_s"], found.cross["ttc_s"]])
    return {
        "min_ttc_s": _extreme(np.min, ttc),
        "min_pet_s": _extreme(np.min, pets),
        "max_drac_mps2": _extreme(np.max, follow["drac_mps2"]),
        "max_braking_mps2": _extreme(np.max, np.maximum(-found.a, 0.0)),
        "pets": len(pets),
        **{name: int((pets < limit).sum()) for name, limit in PETS.items()},
    }


def short_ttc(run: Run) -> Floats:
    """1 for each vehicle with a TTC below `SHORT_TTC` as follower or second, else 0, shape (k,)."""
    follow, cross = run.encounters.follow, run.encounters.cross
    late = (
        follow["follower"][follow["ttc_s"] < SHORT_TTC],
        cross["second"][cross["ttc_s"] < SHORT_TTC],
    )
    return _flags(run, np.concatenate(late))


def short_pet(run: Run) -> Floats:
    """1 for each vehicle with a PET below `SHORT_PET` as the second, else 0, shape (k,)."""
    pets = run.encounters.encroach
    return _flags(run, pets["second"][pets["pet_s"] < SHORT_PET])


def high_drac(run: Run) -> Floats:
    """1 for each vehicle with a DRAC above `HIGH_DRAC`, else 0, shape (k,)."""
    follow = run.encounters.follow
    return _flags(run, follow["follower"][follow["drac_mps2"] > HIGH_DRAC])


def _flags(run: Run, vehicles: npt.ArrayLike) -> Floats:
    return np.isin(run.columns.vehicle, vehicles).astype(float)


def _extreme(of: Callable[[Floats], Any], values: npt.ArrayLike) -> float | None:
    numbers = np.asarray(values, dtype=float)
    numbers = numbers[np.isfinite(numbers)]
    return float(of(numbers)) if len(numbers) else None
