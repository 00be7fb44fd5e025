"""Checks of specification 1.0, by clause."""
