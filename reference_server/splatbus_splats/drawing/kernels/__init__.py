"""The renderer's loops, compiled by Numba when they are first called, and kept where it may."""
