"""Bytes, packets, JSON, messages and recordings: the judge's own reading of them,
with no code of the reference pair.
"""
