"""Mutants of specification 1.0, by the clause that they break."""
