"""What a person sees: settings and status in the sidebar, and what an empty moves."""

from __future__ import annotations

import textwrap
from typing import Any

import bpy

from . import service
from .operators import Connect, Disconnect, SetUpCompositor
from .viewing import MOVES

_MARGIN, _LETTER = 65, 6.2
"""Pixels of a page where no text is, and that a letter takes, before Blender scales them."""


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
        column = layout.column()
        column.enabled = service.connection is None
        for name in ("host", "ipc_port", "message_port"):
            column.prop(settings, name)
        layout.prop(settings, "show")
        end = service.connection is not None
        layout.operator((Disconnect if end else Connect).bl_idname)
        layout.operator(SetUpCompositor.bl_idname)
        width = context.region.width / context.preferences.system.ui_scale
        letters = max(8, int((width - _MARGIN) / _LETTER))
        shown = [(each, "NONE") for each in service.told()]
        shown += [(each, "ERROR") for each in service.complaints()]
        for text, icon in shown:
            lines = layout.column(align=True)
            for line in textwrap.wrap(text, letters, break_on_hyphens=False):
                lines.label(text=line, icon=icon)
                icon = "BLANK1"


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
        column = self.layout.column()
        column.label(text="Splat Object")
        column.prop(context.object, MOVES, text="")


register, unregister = bpy.utils.register_classes_factory((SidebarPanel, EmptyPanel))
