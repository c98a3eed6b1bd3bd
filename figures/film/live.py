"""A view as a picture: the junction as it is now, for driving a run from outside."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg

from figures import style
from figures.junction import drawing
from minisim.control import HALTING, Plan, Site, View

#: Size of the picture [inch], at so many pixels per inch.
SIZE, DPI = 5.0, 100


class Live:
    """The junction of a site, on which `draw` shows the vehicles of a view.

    In a `window` it needs matplotlib's pyplot, and a display: it warns if there is none.
    """

    def __init__(self, site: Site, plan: Plan, *, window: bool = False) -> None:
        self._site, self._window = site, window
        if window:
            from matplotlib import pyplot

            if pyplot.get_backend().lower() == "agg":  # what pyplot takes without a display
                warnings.warn("no window: matplotlib finds no display here", stacklevel=2)
            pyplot.ion()
            self._figure: Any = pyplot.figure(figsize=(SIZE, SIZE), dpi=DPI)
        else:
            self._figure = style.new_figure(SIZE, SIZE, dpi=DPI)
            FigureCanvasAgg(self._figure)
        reach = site.intersection.junction_radius + 60.0
        self._axes = self._figure.add_axes((0.0, 0.0, 1.0, 1.0))
        drawing.draw_junction(self._axes, site.intersection, plan, reach)
        self._ground = len(self._axes.patches)
        self._clock = style.write(self._figure, 0.03, 0.96, "", 12, bold=True)

    def draw(self, view: View) -> npt.NDArray[np.uint8]:
        """The pixels, shape (height, width, 3)."""
        for patch in self._axes.patches[self._ground :]:
            patch.remove()
        intersection = self._site.intersection
        for v in view.vehicles:
            path = intersection.paths[intersection.movements.rows[v.lane][v.manoeuvre]]
            colour = style.WAITING if v.speed <= HALTING else style.FREE
            body = self._site.types[v.type]
            drawing.draw_vehicle(self._axes, path, path.entry - v.distance, body, colour)
        self._clock.set_text(f"{view.time:.0f} s")
        canvas = self._figure.canvas
        canvas.draw()
        if self._window:
            canvas.flush_events()
            return np.zeros((0, 0, 3), np.uint8)
        return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()

    def close(self) -> None:
        """Close the window."""
        if self._window:
            from matplotlib import pyplot

            pyplot.close(self._figure)
