"""Every reader of bytes that others wrote, fed what a mutator makes of a corpus.

    python -m tests.fuzz --seconds 60
    python -m tests.fuzz --seconds 60 --target from_client

A target is a function of bytes that raises nothing: the errors that a reader documents are its
business, whatever else comes is a fault. An input that reaches what none before reached is kept and
mutated in its turn. The same seed makes the same inputs.
"""
