"""Animations of a run."""
