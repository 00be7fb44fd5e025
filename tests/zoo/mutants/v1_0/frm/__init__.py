"""Packets: FRM (spec 1.0 chapter 2)."""
