"""Draws the server's image over whatever framebuffer is bound, by its depth.

No interface is in here: where and when to draw, others say. All arithmetic is in the shader, since
Blender's interface would wait for it on the processor. It needs a context of Blender's GPU module.
"""

from __future__ import annotations

from typing import Any

import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from splatbus_viewer.mirror import Copied

from .core.poses import Rows

LOOKS = ("COMPOSITE", "COLOR", "DEPTH")
_STRAIGHT, _RAYS, _LINEAR = 1, 2, 4
_LONGEST = 3.4e38
"""What stands for infinity, of which a constant of a shader may know nothing."""

_VERTEX = """
void main() { uv = 0.5 * pos + 0.5; gl_Position = vec4(pos, 0.0, 1.0); }
"""
_FRAGMENT = """
vec3 encoded(vec3 linear)
{
  vec3 low = 12.92 * linear, high = 1.055 * pow(max(linear, vec3(0.0)), vec3(1.0 / 2.4)) - 0.055;
  return mix(high, low, lessThanEqual(linear, vec3(0.0031308)));
}

void main()
{
  ivec2 size = textureSize(colors, 0);
  ivec2 at = min(ivec2(uv * vec2(size)), size - 1);
  vec4 color = texelFetch(colors, at, 0);
  float z = texelFetch(depths, at, 0).r;
  bool surface = color.a > 0.0 && z > 0.0 && z < 3.4e38 && z != depth.y;
  if (look == 0 && !surface) discard;
  if ((kind & 2) != 0) {
    vec2 ray = (vec2(uv.x, 1.0 - uv.y) - lens.zw) / lens.xy;
    z /= sqrt(dot(ray, ray) + 1.0);
  }
  z *= depth.x;
  /* Planar depth as the projection of the view has it, in a window from 0 to 1. */
  gl_FragDepth = look == 0 ? clamp(0.5 * (projection.x + projection.y / z) + 0.5, 0.0, 1.0) : 0.0;
  if (look == 2) {
    float far = log(z / depth.z) / log(depth.w / depth.z);
    FragColor = vec4(surface ? vec3(clamp(far, 0.0, 1.0)) : vec3(0.0), 1.0);
  } else {
    vec3 rgb = color.rgb;
    if ((kind & 4) != 0) rgb = encoded((kind & 1) != 0 ? rgb : rgb / max(color.a, 1.0e-6));
    bool multiplied = (kind & 5) == 0;
    rgb = color.a > 0.0 ? (multiplied ? rgb : rgb * color.a) : vec3(0.0);
    FragColor = vec4(rgb, look == 1 ? 1.0 : color.a);
  }
  if (overlaid != 0) FragColor.rgb = pow(max(FragColor.rgb, vec3(0.0)), vec3(2.2));
}
"""


class Canvas:
    """An image on the GPU, and what draws it; belongs to the thread that draws.

    Attributes:
        image: the one that is there; None before the first.
    """

    def __init__(self) -> None:
        self.image: Copied | None = None
        self._shader = _shader()
        corners = [(-1, -1), (1, -1), (-1, 1), (1, 1)]
        self._batch = batch_for_shader(self._shader, "TRI_STRIP", {"pos": corners})
        self._textures: tuple[Any, Any] | None = None

    def take(self, image: Copied) -> None:
        """Bring an image to the GPU, if it is not there yet.

        Args:
            image: with colour; without depth, the look "COLOR" is all that it has.
        """
        if self.image is not image:
            color = _texture(image.color, "RGBA32F")
            depth = color if image.depth is None else _texture(image.depth, "R32F")
            self._textures, self.image = (color, depth), image

    def draw(self, window: Rows, look: str, unit: float = 1.0, *, overlaid: bool = False) -> None:
        """Draw the image that is there over all of the framebuffer.

        Args:
            window: the projection of the view, from the eye's axes to −1…1; a perspective one.
            look: one of `LOOKS`. A composite is drawn where it is nearer than what was drawn.
            unit: Blender's units to one of the splats' scene.
            overlaid: whether it is Blender's layer over a viewport, which mixes C + (1 − a)·B as
                light, and shows its 2.2nd root: opaque splats are shown as they are, others as
                they are over black.
        """
        if self.image is None or self._textures is None:
            return
        for name, texture in zip(("colors", "depths"), self._textures):
            self._shader.uniform_sampler(name, texture)
        self._shader.uniform_float("lens", _lens(self.image))
        self._shader.uniform_float("depth", _depth(self.image, unit))
        self._shader.uniform_float("projection", (-window[2][2], window[2][3]))
        self._shader.uniform_int("look", LOOKS.index(look))
        self._shader.uniform_int("kind", _kind(self.image))
        self._shader.uniform_int("overlaid", int(overlaid))
        state = gpu.state
        before = state.blend_get(), state.depth_test_get(), state.depth_mask_get()
        state.blend_set("ALPHA_PREMULT")
        state.depth_test_set("LESS" if look == "COMPOSITE" else "ALWAYS")
        state.depth_mask_set(False)
        self._batch.draw(self._shader)
        state.blend_set(before[0])
        state.depth_test_set(before[1])
        state.depth_mask_set(before[2])


def _shader() -> Any:
    info, between = gpu.types.GPUShaderCreateInfo(), gpu.types.GPUStageInterfaceInfo("splatbus")
    between.smooth("VEC2", "uv")
    for name, kind in (("lens", "VEC4"), ("depth", "VEC4"), ("projection", "VEC2")):
        info.push_constant(kind, name)
    for name in ("look", "kind", "overlaid"):
        info.push_constant("INT", name)
    info.sampler(0, "FLOAT_2D", "colors")
    info.sampler(1, "FLOAT_2D", "depths")
    info.vertex_in(0, "VEC2", "pos")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "FragColor")
    if hasattr(info, "depth_write"):  # unknown to 4.2, whose OpenGL asks for nothing
        info.depth_write("ANY")
    info.vertex_source(_VERTEX)
    info.fragment_source(_FRAGMENT)
    return gpu.shader.create_from_info(info)


def _texture(image: Any, kind: str) -> Any:
    height, width = image.shape[:2]
    # Blender's textures begin with the bottom row.
    numbers = np.ascontiguousarray(image[::-1]).reshape(-1)
    buffer = gpu.types.Buffer("FLOAT", len(numbers), numbers)
    return gpu.types.GPUTexture((width, height), format=kind, data=buffer)


def _lens(image: Copied) -> tuple[float, float, float, float]:
    """As parts of the image's sides."""
    if (camera := image.camera) is None:
        return 1.0, 1.0, 0.5, 0.5
    width, height = camera.width, camera.height
    return camera.fx / width, camera.fy / height, camera.cx / width, camera.cy / height


def _depth(image: Copied, unit: float) -> tuple[float, float, float, float]:
    near, far = (0.01, 100.0) if image.camera is None else (image.camera.near, image.camera.far)
    return unit, min(image.semantics.depth_empty, _LONGEST), near * unit, far * unit


def _kind(image: Copied) -> int:
    said = image.semantics
    rays = said.depth_kind == "ray_distance" and image.camera is not None
    return (
        _STRAIGHT * (said.alpha == "straight")
        + _RAYS * rays
        + _LINEAR * (said.color_space == "linear")
    )
