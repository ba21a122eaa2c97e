"""Show the windows of one X display, in a process of their own: GLFW reads DISPLAY once, and a display may hang.

window_host.py starts it as `python -m wall.display.window_process PARENT SOCKET MEMORY`, with DISPLAY set. It ends when
the socket closes, and dies with its parent. Messages over the socket are JSON, one a packet. The first names the
panels, and is answered by ["ready", notes] or ["failed", why]. Then the run sends where views are, ["views", places of
each window, how many views there are], at first and when that changes, and images, [window, buffer, width,
height, number, rectangles]: those that differ from the image before, as [x, y, width, height], with their pixels one
behind the other in a buffer of the shared memory. The process sends ["free", window, buffer], ["shown", window, number,
how many images before it were never seen], ["command", command], ["escape", window], ["closed", window], ["lost",
window, why].

Each window has a thread, which waits for the vertical blank of its own monitor only. The main thread takes events of
the X server, another one images. Only this file and window_input.py use GLFW, and only this one and
wall/reconstruction/gpu use OpenGL.
"""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import socket
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import glfw
import moderngl

from wall.core.errors import RunError, WallError
from wall.core.system import die_with
from wall.display.window_input import InputHandler, Views
from wall.display.window_layout import TURNS, Box, Monitor, Place, WindowPosition, WindowRequest, lay_out

START_WAIT_S = 15.0  # for all windows to be there; llvmpipe compiles its shaders in a tenth of a second
OPEN_WAIT_S = 1.5  # for an X server to take a client
END_WAIT_S = 0.5  # for a window to finish its swap
AWAKE_S = 0.5  # threads that draw read the X connection too: an event that one of them takes in ends no wait
MAX_PACKET = 1 << 20
BLACK = (0.0, 0.0, 0.0)
_DITHER = 0x0BD0  # GL_DITHER

_VERTEX = """
#version 330
uniform mat2 picture_from_window;
out vec2 at;
void main() {
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0;
    gl_Position = vec4(corner, 0.0, 1.0);
    at = picture_from_window * (vec2(corner.x, -corner.y) * 0.5) + 0.5;
}
"""
_FRAGMENT = """
#version 330
uniform sampler2D picture;
in vec2 at;
out vec4 colour;
void main() { colour = texture(picture, at); }
"""

Tell = Callable[[list[Any]], None]


class Offered(NamedTuple):
    """An image of a window: the rectangles that differ from the one before, in a buffer."""

    buffer: int
    width: int  # of the whole image
    height: int
    number: int
    rects: list[tuple[int, int, int, int]]  # x, y, width, height


class Window:
    """One panel's window. `offer` takes the newest image; a thread of its own shows it."""

    def __init__(self, index: int, title: str, position: WindowPosition, buffers: list[memoryview], tell: Tell) -> None:
        """Open the window, black. To be called by the main thread, as GLFW wants it."""
        self.index, self.position = index, position
        self._buffers, self._tell = buffers, tell
        self._changed = threading.Condition()
        self._offered: list[Offered] = []  # oldest first
        self._redraw, self._closing = True, False
        self.failed = ""
        self.ready = threading.Event()
        self.handle = _open(f"wall {title}", position)
        self._size = glfw.get_framebuffer_size(self.handle)
        glfw.set_framebuffer_size_callback(self.handle, self._resized)
        glfw.set_window_refresh_callback(self.handle, lambda _: self._again())
        self._thread = threading.Thread(target=self._run, name=f"window {title}", daemon=True)
        self._thread.start()

    def offer(self, offered: Offered) -> None:
        """Show an image, together with one that waits: it has only what differs from that."""
        with self._changed:
            self._offered.append(offered)
            self._changed.notify()

    def close(self) -> None:
        """Let the thread end and close the window; by the main thread."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join(END_WAIT_S)
        if not self._thread.is_alive():
            glfw.destroy_window(self.handle)

    def _resized(self, handle: Any, width: int, height: int) -> None:
        self._size = (width, height)
        self._again()

    def _again(self) -> None:
        with self._changed:
            self._redraw = True
            self._changed.notify()

    def _run(self) -> None:
        try:
            glfw.make_context_current(self.handle)
            self._show_all()
        except Exception as error:  # whatever it was, the run has to hear of it
            self.failed = f"{type(error).__name__}: {error}"
            self._tell(["lost", self.index, self.failed])
        finally:
            self.ready.set()
            glfw.make_context_current(None)  # type: ignore[arg-type]  # None: no window's

    def _show_all(self) -> None:
        context = moderngl.create_context(require=330)
        context.disable_direct(_DITHER)  # display exactly the values that came
        glfw.swap_interval(self.position.interval)
        program = context.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        a, b, c, d = TURNS[self.position.rotation]
        program["picture_from_window"] = (a, c, b, d)  # columns
        triangle = context.vertex_array(program, [])
        texture: Any = None
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closing or self._redraw or self._offered)
                if self._closing:
                    return
                all_offered, self._offered, self._redraw = self._offered, [], False
                width, height = self._size
            for offered in all_offered:
                texture = self._upload(context, texture, offered)
            context.viewport = (0, 0, width, height)
            if texture is None:
                context.clear(*BLACK)
            else:
                same = texture.size == ((width, height) if self.position.rotation % 180 == 0 else (height, width))
                texture.filter = (moderngl.NEAREST,) * 2 if same else (moderngl.LINEAR,) * 2
                texture.use()
                triangle.render(moderngl.TRIANGLES, vertices=3)
            glfw.swap_buffers(self.handle)
            self.ready.set()
            if all_offered:
                self._tell(["shown", self.index, all_offered[-1].number, len(all_offered) - 1])

    def _upload(self, context: Any, texture: Any, offered: Offered) -> Any:
        if texture is None:
            size = offered.width, offered.height
            texture = context.texture(size, 3, bytes(3 * offered.width * offered.height), alignment=1)
            texture.repeat_x = texture.repeat_y = False
        at = 0
        for x, y, width, height in offered.rects:
            behind = at + 3 * width * height
            texture.write(self._buffers[offered.buffer][at:behind], viewport=(x, y, width, height), alignment=1)
            at = behind
        self._tell(["free", self.index, offered.buffer])
        return texture


class WindowProcess:
    """All windows of this process; takes events of the X server and messages of the parent."""

    def __init__(self, pipe: socket.socket, memory: int) -> None:
        self._pipe, self._memory = pipe, memory
        self._sending = threading.Lock()
        self._ended = False
        self.windows: dict[int, Window] = {}
        self._inputs: dict[int, InputHandler] = {}
        self._views = Views()

    def run(self) -> None:
        """Open the windows and serve them until the last is closed or the parent is gone."""
        task = json.loads(self._pipe.recv(MAX_PACKET))
        try:
            self._open(task)
        except WallError as error:
            self.tell(["failed", str(error)])
            return
        threading.Thread(target=self._listen, name="pictures", daemon=True).start()
        while self.windows and not self._ended:
            glfw.wait_events_timeout(AWAKE_S)
            for index, handler in list(self._inputs.items()):
                for command in handler.commands():
                    self.tell(["command", command])
                if handler.escape:
                    self.tell(["escape", index])
                if glfw.window_should_close(self.windows[index].handle):
                    self.windows.pop(index).close()
                    del self._inputs[index]
                    self.tell(["closed", index])
        for window in self.windows.values():
            window.close()

    def tell(self, message: list[Any]) -> None:
        """Send a message to the parent."""
        with self._sending:
            try:
                self._pipe.send(json.dumps(message).encode())
            except OSError:
                self._ended = True  # the parent is gone

    def _open(self, task: dict[str, Any]) -> None:
        display, panels = task["display"], [_request(values) for values in task["panels"]]
        _init(panels[0].id, display)
        shared = memoryview(mmap.mmap(self._memory, 0))
        found = lay_out(panels, _monitors(), display=display)
        for index, (panel, position) in enumerate(zip(panels, found, strict=True)):
            buffers = [shared[start : start + task["bytes"][index]] for start in task["buffers"][index]]
            try:
                window = Window(index, panel.id, position, buffers, self.tell)
            except glfw.GLFWError as error:
                raise RunError(f"panel {panel.id}: no window on display {display} ({_text(error)})") from error
            self.windows[index] = window
            self._inputs[index] = InputHandler(
                window.handle, position.rotation, task["height"] * position.box.height / panel.pixels[1],
                window=index, size=(position.box.width, position.box.height), views=self._views,
            )  # fmt: skip
        for index, window in self.windows.items():
            if not window.ready.wait(START_WAIT_S) or window.failed:
                why = window.failed or f"it did not show anything for {START_WAIT_S:.0f} s"
                raise RunError(f"panel {panels[index].id}: no OpenGL 3.3 in its window on display {display}: {why}")
        self.tell(["ready", [position.note for position in found if position.note]])

    def _listen(self) -> None:
        with contextlib.suppress(OSError):
            while message := self._pipe.recv(MAX_PACKET):
                index, *offered = json.loads(message)
                if index == "views":
                    self._views.lay_out([[Place(**place) for place in own] for own in offered[0]], offered[1])
                elif (window := self.windows.get(index)) is not None:
                    window.offer(Offered(*offered))
        self._ended = True  # the parent is gone
        glfw.post_empty_event()


def _request(values: dict[str, Any]) -> WindowRequest:
    window = values["window"]
    return WindowRequest(**{**values, "pixels": tuple(values["pixels"]), "window": tuple(window) if window else None})


def _init(panel: str, display: str) -> None:
    """Connect to the X server; wait OPEN_WAIT_S for one that restarts, as it does when its last client leaves."""
    glfw.ERROR_REPORTING = "raise"
    limit = time.monotonic() + OPEN_WAIT_S
    while True:
        try:
            glfw.init_hint(glfw.PLATFORM, glfw.PLATFORM_X11)
            glfw.init()
            return
        except glfw.GLFWError as error:
            if time.monotonic() > limit:
                raise RunError(
                    f"panel {panel}: display {display} cannot be opened ({_text(error)}); wanted an X server that is "
                    f"running, has that screen (:0.1 is the second one of :0) and lets this user in (XAUTHORITY: "
                    f"{os.environ.get('XAUTHORITY', 'not set')})"
                ) from error
        time.sleep(0.1)


def _text(error: Exception) -> str:
    """What GLFW said, without its number and its quotes."""
    return str(error).partition(") ")[2].removeprefix("b").strip("'\"")


def _monitors() -> list[Monitor]:
    found = []
    for handle in glfw.get_monitors():
        mode = glfw.get_video_mode(handle)
        box = Box(*glfw.get_monitor_pos(handle), mode.size.width, mode.size.height)
        found.append(Monitor(os.fsdecode(glfw.get_monitor_name(handle)), box, mode.refresh_rate))
    return found


def _open(title: str, position: WindowPosition) -> Any:
    for hint, value in (
        (glfw.CONTEXT_VERSION_MAJOR, 3),
        (glfw.CONTEXT_VERSION_MINOR, 3),
        (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE),
        (glfw.DECORATED, glfw.FALSE),
        (glfw.RESIZABLE, glfw.FALSE),
        (glfw.AUTO_ICONIFY, glfw.FALSE),  # a wall stays when another window is clicked
        (glfw.SRGB_CAPABLE, glfw.FALSE),
        (glfw.VISIBLE, glfw.FALSE),
    ):
        glfw.window_hint(hint, value)
    monitor = None if position.monitor is None else glfw.get_monitors()[position.monitor]
    if monitor is not None:
        glfw.window_hint(glfw.REFRESH_RATE, glfw.get_video_mode(monitor).refresh_rate or glfw.DONT_CARE)
    handle = glfw.create_window(position.box.width, position.box.height, title, monitor, None)
    if monitor is None:
        glfw.set_window_pos(handle, position.box.x, position.box.y)
    else:
        glfw.set_input_mode(handle, glfw.CURSOR, glfw.CURSOR_HIDDEN)
    glfw.show_window(handle)
    glfw.focus_window(handle)  # without a window manager nobody else gives it the keys
    return handle


def main() -> None:
    """Entry point of the process."""
    parent, descriptor, memory = (int(word) for word in sys.argv[1:4])
    die_with(parent)
    pipe = socket.socket(fileno=descriptor)
    WindowProcess(pipe, memory).run()
    sys.stderr.flush()
    os._exit(0)  # a window whose swap never returns must not keep the process


if __name__ == "__main__":
    main()
