"""Cameras of frames, lenses and tags: CAM."""
