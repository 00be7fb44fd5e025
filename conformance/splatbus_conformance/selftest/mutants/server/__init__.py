"""Mutants of the reference server, family by family."""
