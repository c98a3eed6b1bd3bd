"""Figures and tables that need no run: junctions, decisions, harmony matrices and greens."""

from __future__ import annotations

import csv
from functools import partial
from importlib import resources
from itertools import product

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from baselines import webster, webster_delay
from dim import Dim, HarmonyMatrix, explain
from figures import style
from figures.junction import drawing
from figures.junction.all_cases import CLIQUES, draw_cliques
from figures.junction.decision import decision_figure
from figures.studies.shared.section import Item, Section
from figures.tables import Table
from minisim.junction.movements import Movement
from scenarios.library import MAKERS, four_way
from scenarios.scenario import Scenario

#: Number of arms -> the case shown in its picture; for four arms, the paper's.
DECISIONS = {3: ("a1", "b1", "c1"), 4: ("a1", "b2", "c2", "d2"), 5: ("a1", "b2", "c2", "d2", "e2")}
#: Metres shown around each junction of the map.
MAP_REACH = 48.0


def decision(arms: int) -> Figure:
    """Junction and harmony graph of a decision (for four arms, the paper's figure "solution")."""
    site = MAKERS[arms]().site()
    matrix = HarmonyMatrix.from_geometry(site.intersection, site.vehicle)
    return decision_figure(explain(DECISIONS[arms], matrix), site, Dim().start(site).plan)


def maps() -> Figure:
    """The paper's three junctions from above, with lanes, zones and the paths from one lane."""
    figure = style.new_figure(11.0, 4.55)
    for k, (arms, make) in enumerate(MAKERS.items()):
        axes = figure.add_axes((0.008 + 0.331 * k, 0.115, 0.322, 0.78))
        _draw_map(axes, make())
        words = "Y junction" if arms == 3 else "junction"
        style.write(figure, 0.012 + 0.331 * k, 0.945, f"{arms}-way {words}", 12, bold=True)
    x, plan = 0.012, Dim().start(four_way().site()).plan
    for name, words in drawing.zone_words(plan).items():
        figure.add_artist(Rectangle((x, 0.04), 0.018, 0.035, facecolor=style.ZONES[name]))
        style.write(figure, x + 0.024, 0.057, words, 9)
        x += 0.11
    width = four_way().intersection.lane_width
    words = f"blue: the ways out of lane a.  Lanes {width:g} m wide; roads 500 m long; bar 20 m."
    style.write(figure, x + 0.01, 0.057, words, 9)
    return figure


def _draw_map(axes: Axes, scenario: Scenario) -> None:
    intersection = scenario.intersection
    plan = Dim().start(scenario.site()).plan
    drawing.draw_junction(axes, intersection, plan, MAP_REACH)
    for name in axes.texts:
        name.set_fontsize(10)
    for path in intersection.paths:
        if path.movement.origin == 0:
            start, end = path.entry - plan.hold_distance, path.exit + 6.0
            drawing.draw_way(axes, path, start, end, style.BLUE, bold=False)
    left, top = -0.94 * MAP_REACH, 0.94 * MAP_REACH  # no junction in the paper has a road there
    axes.plot([left, left + 20.0], [top, top], color=style.INK, linewidth=2.2, zorder=9,
              solid_capstyle="butt")  # fmt: skip


def worst_case() -> Figure:
    """Four participants with the most tied cliques, and with one more pair in harmony.

    The paper's figure "worst case" draws an abstract graph; these are two real cases at its
    four-way junction, the second with five of six pairs in harmony.
    """
    site = four_way().site()
    matrix = HarmonyMatrix.from_geometry(site.intersection, site.vehicle)
    figure = style.new_figure(9.2, 4.9)
    every = product(*([f"{lane}{manoeuvre}" for manoeuvre in (1, 2, 3)] for lane in "abcd"))
    one_more = next(case for case in every if len(explain(case, matrix).edges) == 5)
    cases = (("a1", "b2", "c1", "d2"), one_more)
    for k, (letter, case) in enumerate(zip("AB", cases, strict=True)):
        left = 0.02 + 0.49 * k
        told = explain(case, matrix)
        axes = figure.add_axes((left, 0.2, 0.47, 0.66))
        draw_cliques(axes, told, site.intersection)
        style.write(figure, left, 0.945, letter, 15, bold=True)
        words = f"{len(told.edges)} of 6 pairs in harmony: {len(told.tied)} largest cliques"
        style.write(figure, left + 0.03, 0.945, words, 12)
        x = left
        for clique, (colour, _) in zip(told.tied, CLIQUES, strict=False):
            names = " ".join(map(str, clique))
            style.write(figure, x, 0.135, names, 12, bold=True, colour=colour)
            x += 0.035 + 0.032 * len(clique)
        names = " ".join(map(str, told.right_of_way))
        style.write(figure, left, 0.06, f"{names} holds the highest-priority lanes and goes.", 10.5)
    return figure


def webster_table() -> Table:
    """Green times of the fixed-time signal: ours by Webster's formula, and the printed ones."""
    file = resources.files("scenarios") / "data" / "webster_table.csv"
    rows = []
    for row in csv.DictReader(file.read_text(encoding="utf-8").splitlines()):
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
            "Saturation flow 1500 veh/h, 2 s lost per phase. The paper rounds 5.08 and 7.11, and "
            "prints 19.75 where its own network file and the formula have 19.25. The formula in "
            "its text divides by C0 − L where it should multiply. The delay is Webster's for the "
            "long run; a run of an hour near x = 1 has less.",
        ),
    )  # fmt: skip


def harmony_table(arms: int) -> Table:
    """The published harmony matrix, and whether the geometry yields the same one."""
    site = MAKERS[arms]().site()
    ours = HarmonyMatrix.from_geometry(site.intersection, site.vehicle)
    paper = HarmonyMatrix.paper(arms)
    different = {pair for a, b in ours.disagreements(paper) for pair in ((a, b), (b, a))}

    def entry(pair: tuple[Movement, Movement]) -> str:
        return f"{int(paper.harmony(*pair))}{'≠' if pair in different else ''}"

    every = paper.movements
    rows = tuple((str(row), *(entry((row, column)) for column in every)) for row in every)
    said = "The corridors swept by the vehicles give the same matrix."
    if different:
        said = f"≠ marks the {len(different) // 2} pairs where the geometry says otherwise."
    return Table(
        f"Harmony matrix of the {arms}-way junction: 1 harmony, 0 conflict",
        ("", *every.names), rows, notes=(said,),
    )  # fmt: skip


SECTION = Section(
    "Junctions and rules",
    (
        Item("maps", "the three junctions from above", maps),
        *(
            Item(f"decision-{arms}way", f"junction with zones and harmony graph, {arms} arms",
                 partial(decision, arms), in_report=arms == 4)
            for arms in DECISIONS
        ),
        Item("worst-case", "the most tied cliques on four arms", worst_case),
        Item("webster", "greens of the fixed-time signal", webster_table),
        *(
            Item(f"harmony-{arms}way", f"harmony matrix, {arms} arms",
                 partial(harmony_table, arms), in_report=arms == 4)
            for arms in DECISIONS
        ),
    ),
)  # fmt: skip
