"""Mutants of the reference pair, one module for each family of requirements."""
