"""Conflict geometry: the junction on paper, its corridors, and where two vehicles come too near."""
