"""Rules of specification 1.1, a module for each clause."""
