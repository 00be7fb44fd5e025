"""Reports of a run: one JSON object, and every other format as a function of it.

So no two formats can say different things, and a stored JSON report can be made into the others
later. Each function takes the reports of one command: one for a run, one for each peer of each
recording for an audit.
"""
