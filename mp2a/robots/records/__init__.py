"""Drives recorded as tables and bags, and bags played back."""
