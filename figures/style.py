"""One look for every figure: colours, type and the bare figure.

The colours are Okabe & Ito's (jfly.uni-koeln.de/color, 2008), which colour-blind readers can tell
apart, and Tol's indigo (personal.sron.nl/~pault), which is as far from all of them. Figures are
made from matplotlib's objects, without pyplot, so nothing here touches global state, a display or
another program's figures.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from minisim.errors import InputError
from minisim.files import AnyPath, replacing
from scenarios.controllers import VARIANTS
from scenarios.controllers import Look as Look

BLUE, ORANGE, GREEN, VERMILLION = "#0072B2", "#E69F00", "#009E73", "#D55E00"
PURPLE, SKY, BLACK = "#CC79A7", "#56B4E9", "#000000"

INK, MUTED, FAINT, PAPER = "#22272E", "#68707C", "#D9DDE3", "#FFFFFF"
GRASS, ASPHALT, PAINT = "#EEF2E8", "#C9CED6", "#FFFFFF"

#: Road markings by the name of their zone; any other zone is drawn in `SKY`. They differ in
#: lightness too, so that any two are far apart for colour-blind eyes.
ZONES = {"red": "#DE856F", "yellow": "#FAE089", "green": "#BEEDC2"}
#: Vehicles by their state.
RIGHT_OF_WAY, WAITING, FREE = BLUE, VERMILLION, "#5C6470"


class Head(NamedTuple):
    """How a state of a signal head is drawn: shapes and widths tell them apart without colour."""

    colour: str
    width: float  #: of its hold line [pt]
    marker: str


#: Signal heads by what they show.
HEADS = {
    "green": Head(GREEN, 6.5, "o"), "amber": Head(ORANGE, 4.0, "^"),
    "red": Head("#A4161A", 1.8, "s"),
}  # fmt: skip

#: Colours by their names in the table of controllers.
COLOURS = {
    "blue": BLUE, "sky": SKY, "green": GREEN, "vermillion": VERMILLION, "orange": ORANGE,
    "purple": PURPLE, "indigo": "#332288", "brown": "#7A4A1E", "ink": INK, "grey": FREE,
}  # fmt: skip

#: By the number of arms.
ARMS = {
    3: Look("3 arms", "green", "^", "--"), 4: Look("4 arms", "blue", "o", "-"),
    5: Look("5 arms", "vermillion", "p", "-."), 6: Look("6 arms", "ink", "h", ":"),
}  # fmt: skip

#: Series that are no controllers of the table: DIM by the number of arms, the optimum's, policies.
SERIES = {
    **{f"dim-{arms}": look for arms, look in ARMS.items()},
    "schedule": Look("schedule (knows all arrivals)", "grey", ".", "-."),
    "learnt": Look("learnt", "indigo", "$L$", "-"),
    "longest wait first": Look("longest wait first", "indigo", "$W$", ":"),
}

#: Font of an axis label.
LABEL: dict[str, Any] = {"fontsize": 9.5, "color": INK}
#: Formats for figure files.
FORMATS = ("png", "pdf", "svg")


def look(series: str) -> Look:
    """The look of a series, as `coloured` gives it; grey for an unknown one."""
    known = VARIANTS[series].look if series in VARIANTS else SERIES.get(series)
    return coloured(known or Look(series, "grey", "$?$", ":"))


def coloured(look: Look) -> Look:
    """A look with its colour in matplotlib's form, in which it may be already."""
    return look._replace(colour=COLOURS.get(look.colour, look.colour))


class ShownFigure(Figure):
    """A figure that shows itself in a notebook, without pyplot or magic words."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()


def new_figure(width: float, height: float, *, dpi: float = 150) -> Figure:
    """An empty figure of width × height inches on white paper."""
    return ShownFigure(figsize=(width, height), dpi=dpi, facecolor=PAPER)


def write(
    figure: Figure, x: float, y: float, text: str, size: float, *, bold: bool = False,
    colour: str = INK, **changes: Any,
) -> Text:  # fmt: skip
    """Write a line of text in a figure, centred on the height `y`."""
    weight = "bold" if bold else "normal"
    return figure.text(
        x, y, text, fontsize=size, fontweight=weight, color=colour, va="center", **changes
    )


def plot_axes(axes: Axes, title: str, xlabel: str, ylabel: str) -> None:
    """Give a plot its quiet frame: a light horizontal grid, no box, title on the left."""
    axes.set_title(title, loc="left", fontsize=11, color=INK, fontweight="bold", pad=10)
    axes.set_xlabel(xlabel, **LABEL)
    axes.set_ylabel(ylabel, **LABEL)
    axes.tick_params(labelsize=9, colors=MUTED, labelcolor=INK, length=3)
    axes.grid(axis="y", color=FAINT, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(MUTED)


def suffix_of(path: AnyPath, what: str, formats: Iterable[str]) -> str:
    """The suffix of a file; raises `InputError` if it is not one of the formats."""
    suffix = Path(path).suffix.lower().removeprefix(".")
    if suffix not in formats:
        allowed = ", ".join(f".{name}" for name in formats)
        raise InputError(f"{what} file ends in {allowed}; got {str(path)!r}")
    return suffix


def figure_format(path: AnyPath) -> str:
    """The format of a figure file by its suffix; raises `InputError` for an unknown one."""
    return suffix_of(path, "a figure", FORMATS)


def save(figure: Figure, path: AnyPath) -> None:
    """Write a figure in the format of its suffix, with the same bytes every time."""
    kind = figure_format(path)
    undated = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}
    with replacing(path) as part, mpl.rc_context({"svg.hashsalt": "minisim", "pdf.fonttype": 42}):
        figure.savefig(part, format=kind, metadata=undated.get(kind, {}))
