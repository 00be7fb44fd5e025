"""One live run: a plan in, a testbed with the testee, workers that go
through the checks, findings out.
"""
