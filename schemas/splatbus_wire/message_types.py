"""The messages of both channels as plain values (1.0 chapter 6; 1.1)."""

from __future__ import annotations

from typing import NamedTuple, Union

from splatbus_wire.init_packet import InitPacket
from splatbus_wire.poses import Pose, Vector

DEFAULT_OBJECT = "default"
"""The object that `point_cloud_pose` moves [OBJ-2]."""


class Intrinsics(NamedTuple):
    """A lens, in pixels of an image of `width` by `height`; clipping planes in scene units [CAM-4].

    Pixel centres are at half-integers: (0.5, 0.5) is the centre of the top-left pixel.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    near: float
    far: float


class CameraPose(NamedTuple):
    """Where the camera is [POS-1]; `timestamp` in seconds of the client's choice [POS-8].

    `tag` comes back with the first image that was rendered with it [CAM-2]; without `intrinsics`
    those before stay in force [CAM-7].
    """

    pose: Pose
    timestamp: float | None = None
    tag: str | None = None
    intrinsics: Intrinsics | None = None


class PointCloudPose(NamedTuple):
    """Where the Gaussians are [POS-1]; `timestamp` in seconds of the client's choice [POS-8]."""

    pose: Pose
    timestamp: float | None = None


class ObjectPose(NamedTuple):
    """Where an object is, and how large: X_world = scale · R · X + position [OBJ-1]."""

    object: str
    pose: Pose
    scale: float = 1.0
    timestamp: float | None = None


class SetTime(NamedTuple):
    """The time in the scene, in seconds, that images are to be rendered at [TIM-1]."""

    time: float


class GetViewportSize(NamedTuple):
    """Asks for the size of the image [REQ-1]; `id` only after `welcome` [NEG-27]."""

    id: int | None = None
    timestamp: float | None = None


class GetCameraPose(NamedTuple):
    """Asks for camera `cam_idx` modulo their number [REQ-2]; `id` only after `welcome` [NEG-27]."""

    cam_idx: int
    id: int | None = None
    timestamp: float | None = None


class GetScene(NamedTuple):
    """Asks what the scene consists of [SCN-1]."""

    id: int | None = None


class SetViewport(NamedTuple):
    """Asks for images of this size, in pixels [VPT-1]."""

    width: int
    height: int
    id: int | None = None


class Ping(NamedTuple):
    """Asks for the server's clock; `t` in seconds on the client's own [PNG-1]."""

    t: float
    id: int | None = None


class ViewportSize(NamedTuple):
    """Answers GetViewportSize and SetViewport, in pixels [REQ-3, VPT-2].

    0 by 0 while the server has no image [REQ-4].
    """

    width: int
    height: int
    id: int | None = None


class CameraReply(NamedTuple):
    """Answers GetCameraPose, camera-to-world [REQ-5]; `intrinsics` where agreed upon [CAM-8]."""

    pose: Pose
    id: int | None = None
    intrinsics: Intrinsics | None = None


class Box(NamedTuple):
    """An axis-aligned box, both ends included."""

    min: Vector
    max: Vector


class SceneObject(NamedTuple):
    """An object of a scene: `bounds` of the centres of its Gaussians, in its own axes, if known."""

    id: str
    name: str
    gaussians: int
    bounds: Box | None = None


class Scene(NamedTuple):
    """Answers GetScene [SCN-2]; `time_range` in seconds, None where nothing moves by itself."""

    objects: tuple[SceneObject, ...]
    time_range: tuple[float, float] | None
    cameras: int
    origin: Vector
    id: int | None = None


class Pong(NamedTuple):
    """Answers Ping [PNG-2]; `server_time` in seconds on the clock of `Frame.rendered_at`."""

    t: float
    server_time: float
    id: int | None = None


class Scalar(NamedTuple):
    """A series of telemetry whose value is a number (1.1 annex A)."""

    name: str
    value: float
    unit: str | None = None


class Histogram(NamedTuple):
    """A series of telemetry; one count fewer than edges, which ascend (1.1 annex A)."""

    name: str
    edges: tuple[float, ...]
    counts: tuple[int, ...]


class Text(NamedTuple):
    """A series of telemetry whose value is a text (1.1 annex A)."""

    name: str
    value: str


Series = Union[Scalar, Histogram, Text]


class SubscribeTelemetry(NamedTuple):
    """Which series to send from now on; None for all [TEL-1]."""

    names: frozenset[str] | None


class Telemetry(NamedTuple):
    """Figures from the renderer; `time` in seconds on the clock of `Frame.rendered_at` [TEL-2]."""

    seq: int
    time: float
    series: tuple[Series, ...]


class Program(NamedTuple):
    """A peer's name and version, for logs and reports."""

    name: str
    version: str


class Hello(NamedTuple):
    """What a client speaks, the version it likes best first, and can do on a channel [NEG-2]."""

    versions: tuple[str, ...]
    client: Program
    capabilities: tuple[str, ...]
    token: str | None = None

    def __repr__(self) -> str:
        """Without the token: what is logged must not grant access."""
        token = None if self.token is None else "…"
        return (
            f"Hello(versions={self.versions!r}, client={self.client!r},"
            f" capabilities={self.capabilities!r}, token={token!r})"
        )


class Welcome(NamedTuple):
    """The version and the capabilities that a connection has from now on [NEG-30]."""

    version: str
    server: Program
    capabilities: tuple[str, ...]


class ErrorMessage(NamedTuple):
    """What was wrong with a message [NEG-23]; `supported` with `unsupported_version` [NEG-10]."""

    code: str
    message: str
    id: int | None = None
    pointer: str | None = None
    supported: tuple[str, ...] | None = None


class Opened(NamedTuple):
    """The memory of a generation is mapped and checked [OPN-2, OPN-13]."""

    generation: int


class OpenFailed(NamedTuple):
    """The memory of a generation cannot be used [OPN-3, OPN-13]."""

    generation: int
    reason: str


class Closed(NamedTuple):
    """The memory of a generation is no longer mapped [OPN-5, OPN-13]."""

    generation: int


class Release(NamedTuple):
    """The slot of a frame is not read any more [IMG-12, IMG-13]."""

    generation: int
    seq: int


class Subscribe(NamedTuple):
    """Which of `color` and `depth` the frames of a connection need to hold [IMG-19]."""

    channels: frozenset[str]


class FrameCamera(NamedTuple):
    """The camera of an image: pose, intrinsics and size in pixels, clipping planes in scene units.

    Pixel centres are at half-integers: (0.5, 0.5) is the centre of the top-left pixel.
    """

    pose: Pose
    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    near: float
    far: float
    tag: str | None = None

    @property
    def intrinsics(self) -> Intrinsics:
        """The lens by itself."""
        return Intrinsics(
            self.fx,
            self.fy,
            self.cx,
            self.cy,
            self.width,
            self.height,
            self.near,
            self.far,
        )


class Placement(NamedTuple):
    """Where an object was in an image, and how large [OBJ-7]."""

    object: str
    pose: Pose
    scale: float = 1.0


class Frame(NamedTuple):
    """An image that is whole, and lent until it is released [IMG-1].

    `time` is in seconds of the scene, `rendered_at` in seconds of the server's monotonic clock. An
    object that `objects` does not list was at the identity, with scale 1.
    """

    generation: int
    seq: int
    slot: int
    camera: FrameCamera
    time: float
    rendered_at: float
    objects: tuple[Placement, ...] = ()


Move = Union[CameraPose, PointCloudPose, ObjectPose, SetTime]
"""What belongs to control of the scene (1.1 section 6.3)."""
Request = Union[GetViewportSize, GetCameraPose, GetScene, SetViewport, Ping]
Reply = Union[ViewportSize, CameraReply, Scene, Pong]
ClientMessage = Union[
    Move, Request, Hello, Opened, OpenFailed, Closed, Release, Subscribe, SubscribeTelemetry
]
ServerMessage = Union[InitPacket, Reply, Welcome, Frame, Telemetry, ErrorMessage]
Message = Union[ClientMessage, ServerMessage]
