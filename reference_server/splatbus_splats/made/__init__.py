"""A scene that is made, with the statistics of trained ones, the same for the same seed.

python -m splatbus_splats.made 250000 garden.ply --cameras cameras.json
"""

from splatbus_splats.made.garden import cameras, garden, poses

__all__ = ["cameras", "garden", "poses"]
