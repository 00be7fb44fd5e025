"""Run time against error: each numeric step in several variants, with the Pareto front.

A study measures one step. How long a variant takes is the ratio to a floor of the same run; how
far off it is, the worst that a search found against exact arithmetic, kept with its input.
"""
