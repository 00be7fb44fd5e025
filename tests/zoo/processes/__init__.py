"""Many programs, started quickly."""
