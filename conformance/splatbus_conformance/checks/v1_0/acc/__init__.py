"""Accuracy: ACC (spec 1.0 section 5.4)."""
