"""Animations of a run: GIF, MP4, or matplotlib's own.

The still ground is drawn once. Each frame restores it and draws only what moves, which takes a few
milliseconds; drawing a full figure takes fifty.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Container, Iterator, Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from PIL import Image

from figures import style
from figures.film import encode, legend
from figures.film.frames import Frames
from figures.film.legend import BAND, DPI, FOOT, HEIGHT, WIDTH
from figures.junction import drawing
from figures.whole import filmed
from minisim.errors import number
from minisim.files import replacing
from minisim.junction.paths import Floats
from minisim.names import name_of
from minisim.results.run import Run

#: Most megabytes of an animation in a notebook.
EMBEDDED = 200.0


def write_animation(
    run: Run, path: str | os.PathLike[str], *, start: float = 0.0, seconds: float = 60.0,
    fps: float = 10.0, progress: Callable[[int, int], None] | None = None,
) -> None:  # fmt: skip
    """Write `seconds` of a run as a .gif or .mp4; see `play` for a page.

    What was not recorded is run again (`figures.whole` says what that costs). There are `fps`
    frames per second, at most one per step, and 50 in a GIF; `progress` gets frames done and the
    total.

    Raises:
        InputError: an unknown suffix, a time after the end of the run, a number out of range, or a
            run in SUMO that was not recorded.
        MissingExtraError: .mp4 without ffmpeg.
        FileError: the file cannot be written.
    """
    kind = encode.animation_format(path)
    fps = min(fps, encode.GIF_FPS) if kind == "gif" else fps
    times = frame_times(start, seconds, fps, run.site.dt)
    picture = Picture(filmed(run, times[0], times[-1]), start)

    def frames() -> Iterator[Image.Image]:
        for done, time in enumerate(times.tolist(), start=1):
            yield picture.draw(time)
            if progress is not None:
                progress(done, len(times))

    with replacing(path) as part:
        if kind == "gif":
            encode.write_gif(frames(), picture.palette(), part, fps)
        else:
            encode.write_mp4(frames(), part, fps)


class Film(FuncAnimation):
    """An animation that shows itself in a notebook."""

    def _repr_html_(self) -> str:
        with mpl.rc_context({"animation.embed_limit": EMBEDDED}):
            return str(self.to_jshtml())


def animation(
    run: Run, *, start: float = 0.0, seconds: float = 20.0, fps: float = 10.0
) -> FuncAnimation:
    """`seconds` of a run as matplotlib's animation, which has `save` and `to_jshtml`.

    A frame takes about 50 ms to draw and 60 KB in a notebook; `write_animation` is ten times as
    fast. The arguments, and what is run again, are those of `write_animation`.
    """
    times = frame_times(start, seconds, fps, run.site.dt)
    return Picture(filmed(run, times[0], times[-1]), start).animation(times, fps)


def frame_times(start: float, seconds: float, fps: float, dt: float) -> Floats:
    """Times of the frames [s]: multiples of the step, about 1/fps apart."""
    number("start [s]", start, low=0)
    number("seconds", seconds, above=0, high=3600)
    number("fps", fps, low=0.1, high=1.0 / dt)
    ticks = np.round((start + np.arange(max(1, round(seconds * fps))) / fps) / dt)
    return np.asarray(ticks * dt)


class Picture:
    """The junction at any recorded time of one run; served vehicles count from `start` [s] on."""

    def __init__(self, run: Run, start: float = 0.0) -> None:
        self.run = run
        self.title = f"{run.scenario.name} · {name_of(run.controller)}"
        self._film = Frames(run, start)
        self._figure = style.new_figure(WIDTH, HEIGHT, dpi=DPI)
        plan, intersection = run.plan, run.site.intersection
        # Far enough to show all markings and a little more [m].
        zone = max((marking.start for marking in plan.markings), default=0.0)
        self._reach = reach = max(40.0, intersection.junction_radius + zone + 4.0)
        self._axes = self._figure.add_axes((0.0, FOOT / HEIGHT, 1.0, WIDTH / HEIGHT))
        drawing.draw_junction(self._axes, intersection, plan, reach)
        self._moving = self._add_moving()
        legend.write_title(self._figure, run, self.title)
        legend.write_legend(self._figure, run, self._film)
        self._clock = legend.write(self._figure, 0.97, HEIGHT - 0.3, "", 18, bold=True, ha="right")
        self._counts = legend.write(self._figure, 0.97, HEIGHT - 0.62, "", 12, ha="right")
        for artist in (*self._moving, self._clock, self._counts):
            artist.set_animated(True)
        agg: Any = FigureCanvasAgg  # its methods have no types
        self._canvas = agg(self._figure)
        self._canvas.draw()
        self._still = self._canvas.copy_from_bbox(self._figure.bbox)
        self._ground = self._still

    def draw(self, time: float) -> Image.Image:
        """The picture at `time` [s]."""
        self._write_numbers(time)
        self._move(time)
        self._canvas.restore_region(self._ground)
        for artist in self._moving:
            self._figure.draw_artist(artist)
        size = self._canvas.get_width_height()
        return Image.frombuffer("RGBA", size, self._canvas.buffer_rgba()).convert("RGB")

    def animation(self, times: Floats, fps: float) -> Film:
        """These times [s] as matplotlib's animation; the picture is no longer for `draw`."""
        moving = (*self._moving, self._clock, self._counts)
        for artist in moving:
            artist.set_animated(False)

        def show(time: float) -> tuple[Artist, ...]:
            self._move(time)
            self._set_numbers(time)
            return moving

        return Film(self._figure, show, times.tolist(), interval=1000.0 / fps)

    def palette(self) -> Image.Image:
        """An indexed image with every colour of the picture; the legend shows them all."""
        return encode.palette_of(self.draw(self._film.busiest))

    def _add_moving(self) -> tuple[Artist, ...]:
        axes, run = self._axes, self.run
        pixels = axes.transData.transform([(0.0, 0.0), (run.site.vehicle.width, 0.0)])
        points = (pixels[1, 0] - pixels[0, 0]) * 72.0 / DPI
        self._ways = LineCollection(
            [], colors=style.RIGHT_OF_WAY, alpha=BAND, linewidths=points, capstyle="butt", zorder=4
        )
        self._bodies = PolyCollection([], edgecolors=style.PAPER, linewidths=0.7, zorder=6)
        self._glass = PolyCollection([], facecolors=style.PAPER, alpha=0.8, linewidths=0, zorder=7)
        self._lamps = PolyCollection(
            [], facecolors="#FFB000", edgecolors=style.INK, linewidths=0.5, zorder=8
        )
        self._harmed = LineCollection([], colors=style.BLACK, linewidths=1.6, zorder=9)
        self._crashes = LineCollection([], colors=style.BLACK, linewidths=3.0, zorder=9)
        self._arrows = PolyCollection([], facecolors=style.PAPER, linewidths=0, zorder=7)
        self._holds = drawing.draw_hold_lines(axes, run.site.intersection, run.plan)
        lines = drawing.hold_lines(run.site.intersection, run.plan)
        self._kerbs = lines[:, 1] + 0.5 * (lines[:, 1] - lines[:, 0])  # where heads stand
        self._heads = {
            state: axes.plot([], [], head.marker, color=head.colour, markersize=8.0, zorder=9,
                             markeredgecolor=style.INK, markeredgewidth=0.7)[0]
            for state, head in style.HEADS.items()
        }  # fmt: skip
        added = (self._bodies, self._glass, self._arrows, self._lamps, self._harmed, self._crashes)
        for artist in (self._ways, *added):
            axes.add_collection(artist)
        return (self._ways, self._holds, *added, *self._heads.values())

    def _move(self, time: float) -> None:
        film, run = self._film, self.run
        now = film.at(time)
        near = film.rows(now, 1.1 * self._reach)
        x, y, angle = film.x[near], film.y[near], film.angle[near]
        shapes = zip(*map(drawing.body_shape, run.site.types), strict=True)
        body, glass = (np.stack(shape)[film.type[near]] for shape in shapes)
        states = np.array([style.FREE, style.WAITING, style.RIGHT_OF_WAY])
        self._bodies.set_verts(list(drawing.place(body, x, y, angle)))
        self._bodies.set_facecolor(states[film.state[near]].tolist())
        human = film.human[near]
        self._bodies.set_edgecolor(np.where(human, style.INK, style.PAPER).tolist())
        self._bodies.set_linewidth(np.where(human, 1.6, 0.7).tolist())
        self._glass.set_verts(list(drawing.place(glass, x, y, angle)))
        self._lamps.set_verts(film.lamps(near) if time % 0.8 < 0.45 else [])
        self._ways.set_segments(film.ways(near))
        self._arrows.set_verts(film.arrows(near))
        self._show_heads(film.heads(time), film.open_lanes(near))
        self._harmed.set_segments(film.crossed_out(near, time))
        self._crashes.set_segments(film.crashes(time))

    def _show_heads(self, shown: Mapping[int, str], opened: Container[int]) -> None:
        """Colour hold lines: by their signal heads, or else of lanes whose first vehicle may go."""
        lanes = range(self.run.site.intersection.n)
        looks = [style.HEADS[shown[i]] if i in shown else None for i in lanes]
        plain = [style.RIGHT_OF_WAY if i in opened else style.INK for i in lanes]
        self._holds.set_color([it.colour if it else c for it, c in zip(looks, plain, strict=True)])
        for state, marks in self._heads.items():
            marks.set_data(*self._kerbs[[i for i in lanes if shown.get(i) == state]].T)

    def _write_numbers(self, time: float) -> None:
        """Write the clock and counters into the ground only if they have changed: text is slow."""
        if not self._set_numbers(time):
            return
        self._canvas.restore_region(self._still)
        self._figure.draw_artist(self._clock)
        self._figure.draw_artist(self._counts)
        self._ground = self._canvas.copy_from_bbox(self._figure.bbox)

    def _set_numbers(self, time: float) -> bool:
        """Set the clock and counters; whether they have changed."""
        film = self._film
        clock = f"{int(time) // 60:02d}:{int(time) % 60:02d}"
        seen = film.rows(film.at(time), self._reach)
        counts = f"in queues {film.waiting(seen)}   served {film.served(time)}"
        if self.run.collisions:
            counts = f"collisions {film.collided(time)}   {counts}"
        before = self._clock.get_text() + self._counts.get_text()
        self._clock.set_text(clock)
        self._counts.set_text(counts)
        return before != clock + counts
