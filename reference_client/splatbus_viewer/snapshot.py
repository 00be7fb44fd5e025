"""One picture of what a server shows, from where it is asked for."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from splatbus_client.loop import clock
from splatbus_client.mapping import MemoryLostError
from splatbus_client.session import Session
from splatbus_wire.poses import Pose

from splatbus_viewer.display import Shown, shown
from splatbus_viewer.picture import three_panels
from splatbus_viewer.poses import same_view


def snapshot(session: Session, path: Path, pose: Pose | None, timeout: float) -> None:
    """Write a picture of the next frame, or of the first one that shows the scene from `pose`.

    Raises:
        TimeoutError: no such frame came within `timeout` seconds; the message says why.
        OSError: the file cannot be written.
        ValueError: the file's name does not end as that of a picture; this is looked at first.
    """
    from PIL import Image  # only now: `picture` says which extra brings it

    if Image.registered_extensions().get(path.suffix.lower()) not in Image.SAVE:
        raise ValueError(f"{path}: the name of a picture has to end in .png, .jpg, .webp or .tiff")
    image = _frame_from(session, pose, clock() + timeout)
    (x, y, z), (i, j, k, w) = image.camera.pose
    caption = f"camera at {x:.4g}, {y:.4g}, {z:.4g}; rotation {i:.4g}, {j:.4g}, {k:.4g}, {w:.4g}"
    three_panels(image, caption).save(path)


def _frame_from(session: Session, pose: Pose | None, end: float) -> Shown:
    if pose is not None:
        session.send_camera(pose)
    others = 0
    while True:
        try:
            lease = session.next_frame(max(0.0, end - clock()))
        except TimeoutError as error:
            if others:
                raise TimeoutError(
                    f"{others} frames came, but none from that pose: perhaps another client"
                    " steers the camera, and keeps it until it leaves [POS-11]"
                ) from None
            raise error
        with lease as frame:
            if not frame.has_camera:
                raise TimeoutError(
                    "images came, but the server speaks 1.0 and does not say what camera they are"
                    " of; splatbus-client view reads them"
                )
            if pose is None or same_view(frame.camera.pose, pose):
                with suppress(MemoryLostError):
                    color, depth = frame.copy("color"), frame.copy("depth")
                    if frame.intact:
                        return shown(color, depth, frame.camera, frame.semantics)
        others += 1
