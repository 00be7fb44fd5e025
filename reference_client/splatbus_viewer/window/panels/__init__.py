"""The interface over the image: what is shown, the scene, figures, packets; by Dear ImGui."""

from splatbus_viewer.window.panels.layout import describe
from splatbus_viewer.window.panels.look import Look

__all__ = ["Look", "describe"]
