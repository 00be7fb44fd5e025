"""`splatbus-client window`: look at a server's images through a window, and steer by hand."""

MODES = ("color", "depth", "normals", "composite")
"""What can be shown; here, where nothing else has to be loaded to know."""
