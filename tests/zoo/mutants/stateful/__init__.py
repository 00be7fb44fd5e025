"""Mutants that only a session of several steps finds."""
