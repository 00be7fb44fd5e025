"""Programs that conform, and programs that do not, by which the harness is judged."""
