"""Connections: CHN (spec 1.0 chapter 3)."""
