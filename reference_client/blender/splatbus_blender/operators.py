"""What a person can do: connect, disconnect, have renders show the splats."""

from __future__ import annotations

from typing import Any

import bpy
from splatbus_wire.settings import settings

from . import compositing, service
from .core.online import is_this_computer
from .properties import where

Done = set[str]


class Connect(bpy.types.Operator):  # type: ignore[misc]
    """Connect to the server of this scene's settings."""

    bl_idname = "splatbus.connect"
    bl_label = "Connect"
    bl_description = "Connect to the SplatBus server, and again whenever it comes back"

    def execute(self, context: Any) -> Done:
        """Begin, and wait for nothing."""
        try:
            host = settings(*where(context.scene.splatbus)).host
        except ValueError as wrong:
            self.report({"ERROR"}, f"SplatBus: {wrong}")
            return {"CANCELLED"}
        # Blender before 4.2 does not ask whether it may.
        if not (getattr(bpy.app, "online_access", True) or is_this_computer(host)):
            why = f"{host} is not this computer: allow online access in the preferences first"
            self.report({"ERROR"}, f"SplatBus: {why}")
            return {"CANCELLED"}
        service.connect(context.scene)
        return {"FINISHED"}


class Disconnect(bpy.types.Operator):  # type: ignore[misc]
    """End the connection."""

    bl_idname = "splatbus.disconnect"
    bl_label = "Disconnect"
    bl_description = "End the connection to the SplatBus server"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Whether there is one."""
        return service.connection is not None

    def execute(self, context: Any) -> Done:
        """End it, and wait for nothing."""
        service.disconnect()
        return {"FINISHED"}


class SetUpCompositor(bpy.types.Operator):  # type: ignore[misc]
    """Have this scene's renders show the splats."""

    bl_idname = "splatbus.set_up_compositor"
    bl_label = "Set Up Compositor"
    bl_description = "Have renders of this scene show the splats among its meshes, by depth"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 - Blender's own way

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Whether it is known in which colour space to mix."""
        return service.images() is not None

    def execute(self, context: Any) -> Done:
        """Add the nodes, or bring up to date what they need."""
        images = service.images()
        if images is None:
            return {"CANCELLED"}
        compositing.set_up(context.scene, encoded=images.semantics.color_space == "srgb")
        return {"FINISHED"}


register, unregister = bpy.utils.register_classes_factory((Connect, Disconnect, SetUpCompositor))
