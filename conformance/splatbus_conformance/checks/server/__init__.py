"""Checks on servers: the harness plays their clients."""
