"""Tables without results: the harmony matrix, and the greens of the fixed-time signal."""

from __future__ import annotations

import csv
from importlib import resources

from baselines import webster, webster_delay
from dim import HarmonyMatrix
from figures.tables import Table
from scenarios.library import MAKERS


def webster_table() -> Table:
    """Green times of the fixed-time signal: ours from Webster's formula, and those printed."""
    file = resources.files("scenarios") / "data" / "webster_table.csv"
    with file.open(encoding="utf-8") as text:
        printed = list(csv.DictReader(text))
    rows = []
    for row in printed:
        rate = float(row["density"])
        timing = webster((rate,) * 4)
        green = timing.greens[0]
        delay = webster_delay(rate, green, timing.cycle)
        rows.append((
            row["density"], row["green_s"], f"{green:.2f}", row["amber_s"], f"{timing.cycle:.2f}",
            f"{timing.flow_ratio:.3f}", f"{timing.saturation[0]:.3f}", f"{delay:.1f}",
        ))  # fmt: skip
    return Table(
        "Green of the fixed-time signal on four arms (Webster 1958)",
        ("veh/h/lane", "paper: green [s]", "ours [s]", "amber [s]", "cycle [s]", "Y", "x",
         "expected delay [s]"),
        tuple(rows),
        notes=(
            "Saturation flow 1500 veh/h, 2 s lost a phase. The paper rounds 5.08 and 7.11, and "
            "prints 19.75 where its own network file and the formula have 19.25. The formula of "
            "its text divides by C0 − L where it must multiply. The delay is Webster's for the "
            "long run; a run of an hour near x = 1 has less.",
        ),
    )  # fmt: skip


def harmony_table(arms: int) -> Table:
    """The harmony matrix: as published, and whether the geometry says the same."""
    site = MAKERS[arms]().site()
    ours = HarmonyMatrix.from_geometry(site.intersection, site.vehicle)
    paper = HarmonyMatrix.paper(arms)
    different = {pair for a, b in ours.disagreements(paper) for pair in ((a, b), (b, a))}
    rows = tuple(
        (str(row), *(
            f"{int(paper[row, column])}{'≠' if (row, column) in different else ''}"
            for column in paper.movements
        ))
        for row in paper.movements
    )  # fmt: skip
    said = (
        "The corridors swept by the vehicles give the same matrix."
        if not different
        else f"≠ marks the {len(different) // 2} pairs where the geometry says otherwise."
    )
    return Table(
        f"Harmony matrix of the {arms}-way junction: 1 harmony, 0 conflict",
        ("", *paper.movements.names), rows, notes=(said,),
    )  # fmt: skip
