"""What images must show: known scenes, cameras, photographs of memory, and what tells them apart.

Arrays in, findings out; the wire is not known here.
"""
