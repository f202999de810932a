"""Formations of robots on flat ground: how they march, and what each robot is told to do."""
