"""What a person sees: settings and status in the sidebar, and what an empty moves."""

from __future__ import annotations

from typing import Any

import bpy

from . import service
from .operators import Connect, Disconnect, SetUpCompositor
from .viewing import MOVES


class SidebarPanel(bpy.types.Panel):  # type: ignore[misc]
    """The page of a viewport's sidebar."""

    bl_idname = "VIEW3D_PT_splatbus"
    bl_label = "SplatBus"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "SplatBus"

    def draw(self, context: Any) -> None:
        """Lay it out; Blender calls this for each drawing."""
        layout, settings = self.layout, context.scene.splatbus
        layout.use_property_split = True
        column = layout.column()
        column.enabled = service.connection is None
        for name in ("host", "ipc_port", "message_port"):
            column.prop(settings, name)
        layout.prop(settings, "show")
        end = service.connection is not None
        layout.operator((Disconnect if end else Connect).bl_idname)
        layout.operator(SetUpCompositor.bl_idname)
        for line in service.told():
            layout.label(text=line)
        for line in service.complaints():
            layout.label(text=line, icon="ERROR")


class EmptyPanel(bpy.types.Panel):  # type: ignore[misc]
    """Among the properties of an empty."""

    bl_idname = "OBJECT_PT_splatbus"
    bl_label = "SplatBus"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Whether it is one."""
        return context.object is not None and context.object.type == "EMPTY"

    def draw(self, context: Any) -> None:
        """Lay it out."""
        self.layout.prop(context.object, MOVES)


register, unregister = bpy.utils.register_classes_factory((SidebarPanel, EmptyPanel))
