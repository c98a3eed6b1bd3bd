"""Conflict geometry: the junction on paper, its corridors, and where two vehicles get too close."""
