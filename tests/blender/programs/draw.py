"""Draws an image over meshes that are drawn before, in a framebuffer that keeps every bit.

    draw.py IMAGES.npz DRAWN.npz

Blender has no GPU in the background before it has rendered with one.
"""

import sys

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from splatbus_blender.drawing import LOOKS, Canvas
from splatbus_viewer.mirror import Copied
from splatbus_wire.message_types import FrameCamera
from splatbus_wire.poses import IDENTITY
from splatbus_wire.semantics import Semantics

NEAR, FAR = 0.5, 100.0
given = np.load(sys.argv[1])
height, width = given["depth"].shape
lens = [float(each) for each in given["lens"]]
camera = FrameCamera(IDENTITY, *lens, width, height, NEAR, FAR)
a, b = -(FAR + NEAR) / (FAR - NEAR), -2 * FAR * NEAR / (FAR - NEAR)
WINDOW = [(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, a, b), (0, 0, -1, 0)]


def image(color, depth, alpha, space, kind):
    semantics = Semantics(alpha, space, kind)
    return Copied(1, given[color].copy(), given[depth].copy(), camera, semantics)


def mesh_shader():
    info, between = gpu.types.GPUShaderCreateInfo(), gpu.types.GPUStageInterfaceInfo("place")
    between.smooth("VEC2", "uv")
    info.push_constant("VEC2", "projection")
    info.sampler(0, "FLOAT_2D", "meshes")
    info.vertex_in(0, "VEC2", "pos")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "FragColor")
    if hasattr(info, "depth_write"):
        info.depth_write("ANY")
    info.vertex_source("void main() { uv = 0.5 * pos + 0.5; gl_Position = vec4(pos, 0.0, 1.0); }")
    info.fragment_source("""
void main()
{
  vec4 mesh = texelFetch(meshes, ivec2(uv * vec2(textureSize(meshes, 0))), 0);
  FragColor = vec4(mesh.rgb, 1.0);
  gl_FragDepth = 0.5 * (projection.x + projection.y / mesh.a) + 0.5;
}
""")
    return gpu.shader.create_from_info(info)


def texture(numbers):
    flat = np.ascontiguousarray(numbers[::-1]).reshape(-1)
    buffer = gpu.types.Buffer("FLOAT", len(flat), flat)
    return gpu.types.GPUTexture((width, height), format="RGBA32F", data=buffer)


def draw_meshes():
    shader = mesh_shader()
    corners = [(-1, -1), (1, -1), (-1, 1), (1, 1)]
    batch = batch_for_shader(shader, "TRI_STRIP", {"pos": corners})
    numbers = np.concatenate([given["meshes"], given["meshes_depth"][..., None]], axis=-1)
    shader.uniform_sampler("meshes", held := texture(numbers))
    shader.uniform_float("projection", (-a, b))
    gpu.state.depth_test_set("ALWAYS")
    gpu.state.depth_mask_set(True)
    batch.draw(shader)
    gpu.state.depth_mask_set(False)
    gpu.state.depth_test_set("NONE")
    return held


def drawn(canvas, splats, look, unit):
    place = gpu.types.GPUOffScreen(width, height, format="RGBA32F")
    with place.bind():
        frame = gpu.state.active_framebuffer_get()
        frame.clear(color=(0, 0, 0, 0), depth=1.0)
        draw_meshes()
        canvas.take(splats)
        canvas.draw(WINDOW, look, unit)
        assert gpu.state.depth_test_get() == "NONE"
        pixels = frame.read_color(0, 0, width, height, 4, 0, "FLOAT")
    place.free()
    return np.array(pixels.to_list(), np.float32).reshape(height, width, 4)[::-1]


scene = bpy.context.scene
scene.render.engine = "BLENDER_WORKBENCH"
scene.render.resolution_x = scene.render.resolution_y = 16
bpy.ops.render.render()
canvas = Canvas()
cases = {
    "plain": (image("color", "depth", "straight", "srgb", "planar_z"), 1.0),
    "other": (image("premultiplied", "rays", "premultiplied", "linear", "ray_distance"), 0.5),
}
found = {
    f"{name} {look}": drawn(canvas, splats, look, unit)
    for name, (splats, unit) in cases.items()
    for look in LOOKS
}
np.savez(sys.argv[2], **found)
print(gpu.platform.backend_type_get(), gpu.platform.renderer_get())
