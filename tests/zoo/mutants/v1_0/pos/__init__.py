"""Poses: POS (spec 1.0 chapter 6)."""
