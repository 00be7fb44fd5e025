"""Allowed variations: servers that are unusual, and conform. The harness must pass them."""
