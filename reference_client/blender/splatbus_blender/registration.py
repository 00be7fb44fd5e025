"""All that the extension adds to Blender, in order."""

from __future__ import annotations

from . import engine, operators, overlay, panels, properties, service

_PARTS = (properties, engine, operators, panels, overlay)


def register() -> None:
    """Add it."""
    for each in _PARTS:
        each.register()


def unregister() -> None:
    """End the connection, and take away what was added."""
    service.unregister()
    for each in reversed(_PARTS):
        each.unregister()
