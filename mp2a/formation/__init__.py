"""Formations of planar robots."""
