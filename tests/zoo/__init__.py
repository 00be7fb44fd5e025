"""The harness judged: the reference client must pass, every mutant of it must die."""
