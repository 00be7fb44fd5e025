"""A check's dealings with a testee: what it sends, sees and waits for.

Scripted peers play the other side; no verdict is given here, but outcomes that a check judges.
"""
