"""Frames and leases: IMG."""
