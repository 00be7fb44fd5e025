"""Mutants whose images are in memory of a GPU."""
