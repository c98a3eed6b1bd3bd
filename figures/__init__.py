"""Figures and animations of decisions, runs and results: the only package that draws.

All figures show themselves in a notebook.
"""

from figures.demo import performance_figure
from figures.film.animate import animation, write_animation
from figures.junction.decision import decision_figure as decision
from figures.player.page import Player, play
from figures.player.scene import read_scene, scene, write_scene
from figures.runs import cumulative, queues, time_space
from figures.style import save

__all__ = [
    "Player",
    "animation",
    "cumulative",
    "decision",
    "performance_figure",
    "play",
    "queues",
    "read_scene",
    "save",
    "scene",
    "time_space",
    "write_animation",
    "write_scene",
]
