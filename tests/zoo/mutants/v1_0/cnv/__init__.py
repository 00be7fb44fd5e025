"""Axes and conventions: CNV (spec 1.0 chapter 5)."""
