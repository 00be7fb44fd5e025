"""Mutants of the reference client, family by family."""
