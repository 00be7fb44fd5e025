"""Mutants of specification 1.1, by the clause that they break."""
