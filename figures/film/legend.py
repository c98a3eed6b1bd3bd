"""What does not move in a film's picture besides the ground: its title, and the legend below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.text import Text

from figures import style
from figures.film.frames import Frames
from figures.junction import drawing
from minisim.results.run import Run

#: Picture size in inches, and its resolution: 720 × 900 pixels. Video needs even numbers.
WIDTH, HEIGHT, DPI = 7.2, 9.0, 100
#: Inches of legend below the junction.
FOOT = 1.02
#: How opaque the band is that shows a vehicle's way.
BAND = 0.28
#: An entry of the legend: colour, words, shape.
Key = tuple[str, str, str]


def write_title(figure: Figure, run: Run, words: str) -> None:
    """Write the title and, below it, what is simulated."""
    scenario = run.scenario
    demand = f"{scenario.density:.0f} veh/h/lane"
    if getattr(scenario, "recorded", None) is not None:
        demand = f"{len(run.columns.lane)} recorded arrivals"
    title = write(figure, 0.03, HEIGHT - 0.3, words, 16, bold=True)
    title.set_fontsize(16 * min(1.0, 0.8 * WIDTH * DPI / title.get_window_extent().width))
    said = f"{demand} · profile {scenario.profile_name} · seed {run.seed}"
    write(figure, 0.03, HEIGHT - 0.62, said, 12, colour=style.MUTED)


def write_legend(figure: Figure, run: Run, film: Frames) -> None:
    """Write the legend: vehicles, hold lines or signal heads, and zones."""
    lines: list[Key] = [(style.RIGHT_OF_WAY, "band: its way", "band")]
    if film.signalled:
        lines += [(head.colour, state, head.marker) for state, head in style.HEADS.items()]
    else:
        lines += [(style.RIGHT_OF_WAY, "hold line: the first may go", "line"),
                  (style.INK, "holds", "line")]  # fmt: skip
    zones = [
        (style.ZONES.get(name, style.SKY), words + drawing.MEANINGS.get(name, ""), "area")
        for name, words in drawing.zone_words(run.plan).items()
    ]
    rows = [row for row in (_vehicles(run, film), lines, zones) if row]
    for k, row in enumerate(rows):
        _write_keys(figure, FOOT / 2.0 + 0.3 * ((len(rows) - 1) / 2.0 - k), row)


def write(figure: Figure, x: float, y: float, text: str, size: float, **font: Any) -> Text:
    """Write a text, `y` inches from the bottom."""
    return style.write(figure, x, y / HEIGHT, text, size, **font)


def _vehicles(run: Run, film: Frames) -> list[Key]:
    keys: list[Key] = [
        (style.RIGHT_OF_WAY, "has the right of way", "body"),
        (style.WAITING, "in a queue", "body"), (style.FREE, "moves", "body"),
    ]  # fmt: skip
    if film.human.any():
        keys.append((style.INK, "outline: human", "body"))
    if run.collisions:
        keys.append((style.BLACK, "collided", "body"))
    return keys


def _write_keys(figure: Figure, y: float, entries: Sequence[Key]) -> None:
    """One line of the legend, `y` inches from the bottom: swatches and what they mean."""
    x, gap = 0.03, 0.04 if len(entries) < 5 else 0.015
    for colour, name, shape in entries:
        _draw_swatch(figure, x, y, colour, shape)
        label = write(figure, x + 0.048, y, name, 12)
        x += 0.048 + label.get_window_extent().width / (WIDTH * DPI) + gap


def _draw_swatch(figure: Figure, x: float, y: float, colour: str, shape: str) -> None:
    """A body, area, band or line, or the marker of a signal head."""
    on: dict[str, Any] = {"transform": figure.transFigure}
    if shape not in ("body", "area", "band", "line"):
        figure.add_artist(Line2D(
            [x + 0.02], [y / HEIGHT], color=colour, marker=shape, markersize=9.0,
            linestyle="none", markeredgecolor=style.INK, markeredgewidth=0.7, **on,
        ))  # fmt: skip
        return
    half = 0.022 if shape == "line" else 0.085
    shoulder = 0.026 if shape == "body" else 0.038
    corners = [(0, -half), (shoulder, -half), (0.038, 0), (shoulder, half), (0, half)]
    figure.add_artist(Polygon(
        [(x + dx, (y + dy) / HEIGHT) for dx, dy in corners], facecolor=colour, linewidth=0,
        alpha=BAND if shape == "band" else 1.0, **on,
    ))  # fmt: skip
