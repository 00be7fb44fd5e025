"""Small faults of the pair, each of which an invariant of the simulation has to find."""
