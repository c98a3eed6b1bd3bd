"""Drawings of a junction: its map, a decision, schematic views."""
