"""What is kept in the file: of a scene, where its server is; of an empty, what it moves."""

from __future__ import annotations

from typing import Any

import bpy

from .viewing import MOVES


class SceneSettings(bpy.types.PropertyGroup):  # type: ignore[misc]
    """Of a scene. No token is among them: files are shared, and it is SPLATBUS_TOKEN alone."""

    host: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Host", description="Empty: SPLATBUS_HOST, or 127.0.0.1"
    )
    ipc_port: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="IPC Port", description="0: SPLATBUS_IPC_PORT, or 6001", min=0, max=65535
    )
    message_port: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Message Port", description="0: SPLATBUS_MSG_PORT, or 6000", min=0, max=65535
    )
    show: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Show",
        items=(
            ("COMPOSITE", "Composite", "Splats among the scene's meshes, by depth"),
            ("COLOR", "Colour", "The server's image alone"),
            ("DEPTH", "Depth", "How far what it shows is: black is near, white is far"),
        ),
    )


def where(settings: Any) -> tuple[str | None, int | None, int | None]:
    """Return host and ports of a scene's settings; None for what the environment says."""
    return settings.host or None, settings.ipc_port or None, settings.message_port or None


def register() -> None:
    """Add them to Blender's types."""
    bpy.utils.register_class(SceneSettings)
    bpy.types.Scene.splatbus = bpy.props.PointerProperty(type=SceneSettings)
    moves = bpy.props.StringProperty(
        name="Splat Object", description="Which object of the server's scene this empty moves"
    )
    setattr(bpy.types.Object, MOVES, moves)


def unregister() -> None:
    """Take them away again; files keep what they hold."""
    delattr(bpy.types.Object, MOVES)
    del bpy.types.Scene.splatbus
    bpy.utils.unregister_class(SceneSettings)
