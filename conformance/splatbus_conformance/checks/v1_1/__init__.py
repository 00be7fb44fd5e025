"""Checks of specification 1.1, by clause."""
