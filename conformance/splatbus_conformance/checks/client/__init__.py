"""Checks on clients: the harness plays the server."""
