"""Rules of specification 1.0, a module for each clause."""
