"""A window of the system with an OpenGL context and an interface of Dear ImGui over it."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path
from typing import Any

import imgui_bundle

# The bundle brings the library of GLFW that both must use, and says so when it is imported first.
from imgui_bundle import imgui, imguizmo, implot

import glfw  # isort: skip
import moderngl  # isort: skip

SETTLING_SECONDS = 0.2
"""An interface goes on to change for a few images after it was touched."""


class NoScreenError(OSError):
    """There is no display, or none with OpenGL 3.3."""


class Screen:
    """One window, until `close`.

    Args:
        size: width and height that are wanted, in the units of the desktop.
        title: of the window.

    Attributes:
        context: of OpenGL, current on this thread.
        touched_at: when somebody moved the mouse, pressed a key or changed the window last.

    Raises:
        NoScreenError: no such window can be had; the message says what to do.
    """

    def __init__(self, size: tuple[int, int], title: str) -> None:
        glfw.ERROR_REPORTING = "ignore"  # they are asked for
        if not glfw.init():
            raise NoScreenError(f"there is no display ({_reason()}); {_ADVICE}")
        for hint, value in _HINTS.items():
            glfw.window_hint(hint, value)
        self._window = glfw.create_window(*size, title, None, None)
        if not self._window:
            reason = _reason()
            glfw.terminate()
            raise NoScreenError(f"there is no window with OpenGL 3.3 ({reason}); {_ADVICE}")
        glfw.make_context_current(self._window)
        glfw.swap_interval(1)
        self.context = moderngl.create_context()
        self.touched_at = 0.0
        self._was_touched = True
        for listen in _EVENTS:
            listen(self._window, self._touch)
        self._interface()

    def wait(self, seconds: float, now: float) -> None:
        """Take what the user did; wait so long for it at most, or until `wake`."""
        if seconds > 0.0:
            glfw.wait_events_timeout(seconds)
        else:
            glfw.poll_events()
        if self._was_touched:
            self._was_touched, self.touched_at = False, now

    @property
    def is_closing(self) -> bool:
        """Whether the user wants it closed."""
        return bool(glfw.window_should_close(self._window))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        width, height = glfw.get_framebuffer_size(self._window)
        return width, height

    @property
    def scale(self) -> float:
        """Pixels per unit of the desktop, in which the interface is laid out."""
        return self.size[0] / max(glfw.get_window_size(self._window)[0], 1)

    def resize(self, width: int, height: int) -> None:
        """Change the size, in the units of the desktop, as a user does by a corner."""
        glfw.set_window_size(self._window, width, height)

    def begin(self) -> None:
        """Begin an image: the interface may be described."""
        imgui.backends.opengl3_new_frame()
        imgui.backends.glfw_new_frame()
        imgui.new_frame()
        imguizmo.im_guizmo.begin_frame()

    def describe_end(self) -> None:
        """End the description; what lies below is drawn next, then `end`."""
        imgui.render()

    def end(self) -> None:
        """Draw the interface over all."""
        self.context.screen.use()
        self.context.viewport = 0, 0, *self.size
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())

    def show(self) -> None:
        """Show what was drawn."""
        glfw.swap_buffers(self._window)

    def close(self) -> None:
        """Close it, and give back all."""
        imgui.backends.opengl3_shutdown()
        imgui.backends.glfw_shutdown()
        implot.destroy_context()
        imgui.destroy_context()
        glfw.terminate()

    def _touch(self, *_: Any) -> None:
        self._was_touched = True

    def _interface(self) -> None:
        imgui.create_context()
        implot.create_context()
        io = imgui.get_io()
        io.set_ini_filename("")
        io.config_flags |= imgui.ConfigFlags_.docking_enable
        io.config_windows_move_from_title_bar_only = True
        fonts = Path(imgui_bundle.__file__).parent / "assets" / "fonts"
        for name, size in _FONTS.items():
            io.fonts.add_font_from_file_ttf(str(fonts / name), size)
        imgui.style_colors_dark()
        style = imgui.get_style()
        style.window_rounding = style.frame_rounding = style.grab_rounding = 3.0
        address = ctypes.cast(self._window, ctypes.c_void_p).value
        assert address is not None
        imgui.backends.glfw_init_for_opengl(address, True)  # it goes on to call what listens
        imgui.backends.opengl3_init("#version 330")


def monospaced() -> imgui.ImFont:
    """Return the font of what is set in columns."""
    font: imgui.ImFont = imgui.get_io().fonts.fonts[1]
    return font


def wake() -> None:
    """End a `wait` of the thread that has the window; from any thread."""
    glfw.post_empty_event()


def _reason() -> str:
    _, text = glfw.get_error()
    return text.decode() if isinstance(text, bytes) else str(text or "no reason given")


_ADVICE = (
    "without one, splatbus-client view and splatbus-client snapshot show images"
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY") or os.name == "nt"
    else "set DISPLAY or WAYLAND_DISPLAY, or try splatbus-client view, which needs no window"
)
_FONTS = {"Roboto/Roboto-Regular.ttf": 15.0, "Inconsolata-Medium.ttf": 14.0}
_HINTS = {
    glfw.CONTEXT_VERSION_MAJOR: 3,
    glfw.CONTEXT_VERSION_MINOR: 3,
    glfw.OPENGL_PROFILE: glfw.OPENGL_CORE_PROFILE,
    glfw.OPENGL_FORWARD_COMPAT: True,
    glfw.SAMPLES: 0,
}
_EVENTS = (
    glfw.set_cursor_pos_callback,
    glfw.set_mouse_button_callback,
    glfw.set_scroll_callback,
    glfw.set_key_callback,
    glfw.set_char_callback,
    glfw.set_window_focus_callback,
    glfw.set_window_refresh_callback,
    glfw.set_framebuffer_size_callback,
)
