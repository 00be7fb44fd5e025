"""What Blender 5.0 names otherwise than 4.2 did, where nodes and passes are concerned.

5.0 has a scene's compositor in a node group of its own, with an output like any group's; nodes of
shaders do its arithmetic, and what were properties of a node are sockets.
"""

from __future__ import annotations

from typing import Any

import bpy
from numpy.typing import NDArray

IS_5 = bpy.app.version >= (5, 0, 0)
MATH = "ShaderNodeMath" if IS_5 else "CompositorNodeMath"
WORKING_SPACE = "scene_linear" if IS_5 else "Linear Rec.709"
"""What is composited in: 5.0 lets a file choose, before it was in Blender's configuration."""
TREE = "CompositorNodeTree"


def compositor(scene: Any) -> Any:
    """Return a scene's node tree for compositing; one that shows the render, if it had none."""
    if not IS_5:
        scene.use_nodes = True
        return scene.node_tree
    if scene.compositing_node_group is None:
        tree = bpy.data.node_groups.new("Compositing", TREE)
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        layers = tree.nodes.new("CompositorNodeRLayers")
        layers.scene = scene
        tree.links.new(layers.outputs["Image"], tree.nodes.new("NodeGroupOutput").inputs[0])
        scene.compositing_node_group = tree
    return scene.compositing_node_group


def existing_compositor(scene: Any) -> Any:
    """Return a scene's node tree for compositing; None if it has none, or does not use it."""
    if IS_5:
        return scene.compositing_node_group
    return scene.node_tree if scene.use_nodes else None


def shown(tree: Any) -> Any:
    """Return the socket that takes what a compositor shows in the end."""
    kind = "NodeGroupOutput" if IS_5 else "CompositorNodeComposite"
    for node in tree.nodes:
        if node.bl_idname == kind:
            return node.inputs[0]
    return tree.nodes.new(kind).inputs[0]


def over(tree: Any, background: Any, foreground: Any, factor: Any) -> Any:
    """Add C·f + (1 − a·f)·B, of sockets, and return the socket of the result."""
    node = tree.nodes.new("CompositorNodeAlphaOver")
    places = {each.identifier: each for each in node.inputs}
    names = ("Background", "Foreground") if IS_5 else ("Image", "Image_001")
    for name, socket in zip((*names, "Fac"), (background, foreground, factor)):
        tree.links.new(socket, places[name])
    return node.outputs[0]


def fill(render_pass: Any, numbers: NDArray[Any]) -> None:
    """Write a pass of a render, of numbers that lie as Blender has them."""
    if IS_5:
        render_pass.rect.foreach_set(numbers)
    else:
        render_pass.rect = numbers.reshape(-1, render_pass.channels)
