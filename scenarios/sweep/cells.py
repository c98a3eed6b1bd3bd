"""Rows of a sweep averaged over seeds, and controllers compared on common arrivals.

A cell holds the runs that differ only in their seed. Recorded arrivals that differ by seed count
as draws: their cell has their mean density.
"""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any, Final

from minisim.errors import InputError, choice
from minisim.results.metric import BEGINNINGS, Metric
from scenarios.statistics import FILLING, mean_interval, prediction_interval
from scenarios.sweep.rows import grows

if TYPE_CHECKING:
    import pandas as pd

#: Columns that name a cell.
CELL: Final = (
    "scenario", "arms", "side", "profile", "fleet", "split", "turns", "density", "horizon_s",
    "warmup_s", "controller",
)  # fmt: skip

#: Summed over the runs of a cell.
SUMS: Final = ("trips", "unfinished", "collisions")

#: Other columns of runs that are not metrics.
OTHERS: Final = (
    "recipe", "host", "seed", "growing", "spillback_s", "arrivals", "cpu_s", "version", "error",
)  # fmt: skip


def cells(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per cell, in the order of `rows`.

    Returns:
        `CELL`; the numbers of `runs` that succeeded and that `failed`; the sums `trips`,
        `unfinished` and `collisions`; the means of the columns `averaged`, with the half widths of
        the 95 % confidence interval (`…_ci95`) and of the 95 % prediction interval for one more run
        (`…_pi95`), NaN if unknown; `growing` (`saturated`), `too_short`, `spillback` (whether a
        queue reached the end of its road) and the mean `cpu_s`.

    Raises:
        InputError: rows of one cell that differ in more than their seed, or have the same seed.
    """
    import pandas as pd

    made = []
    for names, group in _checked(rows).groupby(list(CELL), sort=False):
        good = group[group["error"].isna()]
        counts = {"runs": len(good), "failed": len(group) - len(good)}
        means = _averaged(good) if len(good) else {}
        made.append({**dict(zip(CELL, names, strict=True)), **counts, **means})
    return pd.DataFrame(made)


def _checked(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows whose cells hold runs that differ in their seed alone; raises `InputError`."""
    rows = rows.reset_index(drop=True)
    named = [column for column in CELL if column != "density"]
    for _, draws in rows[rows["split"] == "recorded"].groupby(named):
        if draws["density"].nunique() > 1 and draws["seed"].is_unique:
            rows.loc[draws.index, "density"] = round(draws["density"].mean(), 6)
    for _, group in rows.groupby(list(CELL), sort=False):
        first = group.iloc[0]
        what = f"{first['controller']} on {first['scenario']} at {first['density']:g} veh/h/lane"
        if "recipe" in group and group["recipe"].nunique() > 1:
            advice = "give each its own label or name"
            raise InputError(f"different controllers or scenarios are called {what}; {advice}")
        if not group["seed"].is_unique:
            twice = group["seed"][group["seed"].duplicated()].iloc[0]
            raise InputError(f"{what} has several runs of seed {twice}; keep one of them")
    return rows


def averaged(rows: pd.DataFrame) -> list[str]:
    """Columns that are averaged: both forms of the usual means, and metrics that were asked for."""
    known = {*CELL, *SUMS, *OTHERS}
    groups = BEGINNINGS[1:]
    left = [c for c in rows.columns if c not in known and not c.startswith(groups)]
    present = {column: rows[column].dropna() for column in left}
    return [c for c, of in present.items() if len(of) and all(isinstance(v, Real) for v in of)]


def differences(rows: pd.DataFrame, metric: str | Metric, first: str, second: str) -> pd.DataFrame:
    """Mean run-by-run difference between two controllers in `metric`, a column or a `Metric`.

    Returns:
        One row per cell that both ran: `CELL` without the controller, the number of `pairs`,
        `difference` (the first controller's value less the second's) and `difference_ci95`.

    Raises:
        InputError: an unknown metric or controller, arrivals that differ, or as by `cells`.
    """
    import pandas as pd

    rows = _checked(rows)
    metric = metric.name if isinstance(metric, Metric) else metric
    choice("metric", metric, averaged(rows))
    for name in (first, second):
        choice("controller of these rows", name, sorted(set(rows["controller"])))
    by = [column for column in CELL if column != "controller"]
    gaps = []
    for names, values in pairs(rows, metric, "controller", (first, second), by).items():
        interval = mean_interval(values)
        gaps.append([*names, interval.size, interval.mean, interval.half_width])
    return pd.DataFrame(gaps, columns=[*by, "pairs", "difference", "difference_ci95"])


def pairs(
    rows: pd.DataFrame, metric: str, column: str, names: tuple[str, str], by: Sequence[str]
) -> dict[tuple[Any, ...], list[float]]:
    """Differences in `metric` between two controllers: values of `by` -> one value per seed.

    Runs are paired by seed, so that the variation of the arrivals cancels. A difference is the
    first controller's value less the second's; failed runs and missing values are left out.
    `column`, such as "controller", has the names, and the columns `by` name a cell. Raises
    `InputError` if arrivals of one seed differ, or a controller has two runs of one seed.
    """
    known = rows["error"].isna() & rows[metric].notna() if metric in rows else slice(0)
    good = rows[known].filter([*by, "seed", column, "arrivals", metric])
    one, other = (good[good[column] == name] for name in names)
    for name, runs in zip(names, (one, other), strict=True):
        if runs.duplicated([*by, "seed"]).any():
            raise InputError(f"{name} has several runs of one seed with equal {', '.join(by)}")
    both = one.merge(other, on=[*by, "seed"], suffixes=("", "_other"))
    if (both["arrivals"] != both["arrivals_other"]).any():
        raise InputError(f"{' and '.join(names)} had different arrivals")
    gap = both[metric].astype(float) - both[f"{metric}_other"].astype(float)
    grouped = gap.groupby([both[key] for key in by], sort=False)
    return {key: values.tolist() for key, values in grouped}


def _averaged(good: pd.DataFrame) -> dict[str, object]:
    cell: dict[str, object] = {name: int(good[name].sum()) for name in SUMS}
    for metric in averaged(good):
        values = good[metric].dropna().astype(float).tolist()
        if values:
            interval = mean_interval(values)
            cell[metric] = interval.mean
            cell[f"{metric}_ci95"] = interval.half_width
            cell[f"{metric}_pi95"] = prediction_interval(values).half_width
    cpu = float(good["cpu_s"].mean())
    spilled = "spillback_s" in good and bool(good["spillback_s"].notna().any())
    unsettled = {"growing": saturated(good), "too_short": too_short(good), "spillback": spilled}
    return {**cell, **unsettled, "cpu_s": cpu}


def saturated(good: pd.DataFrame) -> bool:
    """Whether the queues of a cell's runs kept growing; false if the runs are `too_short`."""
    counts = [name for name in good.columns if name.endswith(("queue_growth", "trips"))]
    return not too_short(good) and grows(good[counts].sum(), int(good["arms"].iloc[0]))


def too_short(good: pd.DataFrame) -> bool:
    """Whether a cell's runs end before growing queues can be told from roads still filling up.

    The time on a free road is travel less loss, of the trips that ended or else of all.
    """
    horizon = float(good["horizon_s"].iloc[0]) - float(good["warmup_s"].iloc[0])
    ended, driven = (
        (good[f"{form}travel_time_s"].astype(float) - good[f"{form}time_loss_s"].astype(float))
        for form in ("", "complete_")
    )
    free = ended.fillna(driven).mean()
    return bool(horizon < FILLING * free)
