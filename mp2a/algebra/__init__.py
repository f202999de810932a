"""Segment algebras: what two neighbouring pieces of a chain amount to together. Pure functions, batched."""
