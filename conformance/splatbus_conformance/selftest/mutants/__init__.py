"""Mutants of the reference client, one module for each family of requirements."""
