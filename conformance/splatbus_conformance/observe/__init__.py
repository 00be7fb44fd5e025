"""Judging without taking part: recordings, the proxy between two
others, a session while it lasts.
"""
