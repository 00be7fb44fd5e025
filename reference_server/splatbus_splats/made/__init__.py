"""Scenes that are made, with the statistics of trained ones, the same for the same seed.

python -m splatbus_splats.made 100000 scene.ply
python -m splatbus_splats.made 250000 garden.ply --scene garden --cameras cameras.json
"""

from splatbus_splats.made.balls import made
from splatbus_splats.made.command import main
from splatbus_splats.made.garden import garden

__all__ = ["garden", "made", "main"]
