"""SplatBus in Blender.

`core` knows nothing of Blender, `reading` and `viewing` take its things and do not import it;
`service` and what stands on it do. Importing this imports none of them, so that what needs no
Blender can be tried without it.
"""

from __future__ import annotations


def register() -> None:
    """Begin; called by Blender when the extension is enabled."""
    from . import registration

    registration.register()


def unregister() -> None:
    """End, and leave nothing that goes on; called by Blender when it is disabled, or ends."""
    from . import registration

    registration.unregister()
