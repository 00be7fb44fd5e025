"""Allowed variations of the reference pair."""
