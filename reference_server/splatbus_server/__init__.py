"""The renderer's side of SplatBus: let viewers see what you render, and steer it.

import splatbus_server as splatbus

with splatbus.serve(width, height) as bus:
    while running:
        view = bus.next_view(timeout=0.1)
        if view is not None:
            color, depth = render(view.object_to_camera, view.intrinsics)
            bus.publish(view, color, depth)
"""

from splatbus_wire.messages import Box, SceneObject
from splatbus_wire.poses import Pose
from splatbus_wire.relative import PixelErrors
from splatbus_wire.semantics import Semantics

from splatbus_server.api import Address, Bus, serve
from splatbus_server.limits import Limits
from splatbus_server.statistics import Statistics
from splatbus_server.view import Intrinsics, View, field_of_view

__all__ = [
    "Address",
    "Box",
    "Bus",
    "Intrinsics",
    "Limits",
    "PixelErrors",
    "Pose",
    "SceneObject",
    "Semantics",
    "Statistics",
    "View",
    "field_of_view",
    "serve",
]
