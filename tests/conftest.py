"""For every test: Hypothesis has no deadline, since a machine that is busy is no defect."""

from hypothesis import settings

settings.register_profile("no deadline", deadline=None)
settings.load_profile("no deadline")
