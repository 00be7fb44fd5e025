"""The nodes that put the server's image among a scene's meshes, when it is rendered.

A second scene, whose engine is the server, renders the splats; what is added to the scene's own
compositor is a group that mixes both by depth, in the colour space of the server's image [MEM-13].
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

from . import nodes
from .viewing import movers_of

ENGINE = "SPLATBUS"
ENCODED = "splatbus_encoded"
"""The property of the splats' scene that tells whether the nodes mix in sRGB."""
_INPUTS = (
    ("Image", "NodeSocketColor"),
    ("Depth", "NodeSocketFloat"),
    ("Splats", "NodeSocketColor"),
    ("Splats Depth", "NodeSocketFloat"),
)


def set_up(scene: Any, *, encoded: bool) -> Any:
    """Have a scene's renders show the splats, and return the scene that renders those.

    Doing it again brings that scene up to date with the camera and the empties of this one.

    Args:
        scene: with meshes.
        encoded: whether the server's colours are sRGB's, or linear.
    """
    tree = nodes.compositor(scene)
    splats = splats_of(scene)
    if splats is None:
        splats = _new_splats(scene)
        _insert(scene, tree, splats)
    splats[ENCODED] = encoded
    (group,) = (node for node in tree.nodes if _is_ours(node))
    former = group.node_tree
    group.node_tree = _mixing(encoded)
    if former is not None and former.users == 0:
        bpy.data.node_groups.remove(former)
    _link(scene, splats)
    return splats


def splats_of(scene: Any) -> Any:
    """Return the scene that renders the splats for this one; None if it was not set up."""
    tree = nodes.existing_compositor(scene)
    found = (each.scene for each in _layers(tree) if _is_splats(each.scene))
    return next(found, None)


def scene_of(splats: Any) -> Any:
    """Return the scene whose compositor shows the splats of this one; None if none does."""
    return next((each for each in bpy.data.scenes if splats_of(each) == splats), None)


def missing(scene: Any, splats: Any) -> list[str]:
    """Return the names of what came to a scene since it was set up, and steers the server."""
    return [each.name for each in _steering(scene) if each.name not in splats.collection.objects]


def _new_splats(scene: Any) -> Any:
    splats = bpy.data.scenes.new(f"{scene.name} Splats")
    splats.render.engine = ENGINE
    splats.view_layers[0].use_pass_z = True
    return splats


def _insert(scene: Any, tree: Any, splats: Any) -> None:
    """Put the group before what is shown, behind all that the compositor did so far."""
    layer = scene.view_layers[0]
    layer.use_pass_z = True
    own, theirs = (_layers_of(tree, each) for each in (scene, splats))
    group = tree.nodes.new("CompositorNodeGroup")
    group.node_tree = _mixing(encoded=True)
    group.name = group.label = "SplatBus"
    end = nodes.shown(tree)
    image = end.links[0].from_socket if end.is_linked else own.outputs["Image"]
    tree.links.new(image, group.inputs["Image"])
    tree.links.new(own.outputs["Depth"], group.inputs["Depth"])
    tree.links.new(theirs.outputs["Image"], group.inputs["Splats"])
    tree.links.new(theirs.outputs["Depth"], group.inputs["Splats Depth"])
    tree.links.new(group.outputs[0], end)
    scene.render.use_compositing = True


def _mixing(encoded: bool) -> Any:
    tree = bpy.data.node_groups.new("SplatBus", nodes.TREE)
    for name, kind in _INPUTS:
        tree.interface.new_socket(name, in_out="INPUT", socket_type=kind)
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    given = tree.nodes.new("NodeGroupInput").outputs
    nearer = tree.nodes.new(nodes.MATH)
    nearer.operation = "LESS_THAN"
    tree.links.new(given["Splats Depth"], nearer.inputs[0])
    tree.links.new(given["Depth"], nearer.inputs[1])
    behind = _converted(tree, given["Image"], "to_color_space") if encoded else given["Image"]
    mixed = nodes.over(tree, behind, given["Splats"], nearer.outputs[0])
    result = _converted(tree, mixed, "from_color_space") if encoded else mixed
    tree.links.new(result, tree.nodes.new("NodeGroupOutput").inputs[0])
    return tree


def _converted(tree: Any, socket: Any, which: str) -> Any:
    node = tree.nodes.new("CompositorNodeConvertColorSpace")
    node.from_color_space = node.to_color_space = nodes.WORKING_SPACE
    setattr(node, which, "sRGB")
    tree.links.new(socket, node.inputs[0])
    return node.outputs[0]


def _layers_of(tree: Any, scene: Any) -> Any:
    found = next((each for each in _layers(tree) if each.scene == scene), None)
    if found is None:
        found = tree.nodes.new("CompositorNodeRLayers")
        found.scene = scene
    return found


def _layers(tree: Any) -> Iterator[Any]:
    if tree is not None:
        yield from (each for each in tree.nodes if each.bl_idname == "CompositorNodeRLayers")


def _is_splats(scene: Any) -> bool:
    return scene is not None and scene.render.engine == ENGINE


def _is_ours(node: Any) -> bool:
    return bool(node.bl_idname == "CompositorNodeGroup" and node.name.startswith("SplatBus"))


def _steering(scene: Any) -> list[Any]:
    empties = movers_of(scene)
    return empties if scene.camera is None else [scene.camera, *empties]


def _link(scene: Any, splats: Any) -> None:
    """What is in that scene is evaluated at the frame that it renders."""
    splats.camera = scene.camera
    for each in _steering(scene):
        if each.name not in splats.collection.objects:
            splats.collection.objects.link(each)
