"""The points of the reference programs at which faults are put in, each named once."""
