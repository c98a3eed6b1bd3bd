"""Figures and animations of decisions, runs and results: the only room that draws."""

from figures.demo import performance_figure
from figures.film.animate import write_animation
from figures.junction.decision import decision_figure
from figures.style import save

__all__ = ["decision_figure", "performance_figure", "save", "write_animation"]
