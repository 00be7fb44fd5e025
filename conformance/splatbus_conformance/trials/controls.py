"""Good requests and poses that show that a server goes on, and what is there to answer to these.

What went before may have been answered too, though it should not: such an answer must not be taken
for the control's.
"""

import itertools
from collections.abc import Iterable, Sequence

from splatbus_conformance.wire.json_values import finites, within
from splatbus_conformance.wire.messages import Json, camera_pose

VIEWPORT_REQUEST: Json = {"type": "get_viewport_size"}
CAMERA_REQUEST: Json = {"type": "get_camera_pose", "cam_idx": 0}
_SIGNS = {"get_viewport_size": "viewport_size", "get_camera_pose": "position"}
"""What only the reply to each has."""
STEP = 2.0**-4
"""How far apart the places are where a trial poses the camera, in scene units."""
_places = itertools.count(1)
_ids = itertools.count(2**30)
"""What no check gives a request of its own by chance."""


def one(by_id: bool, said: Sequence[Json] = (), heard: Sequence[Json] = ()) -> Json:
    """A good request, for whose reply none to what was said before can be taken.

    By its id, where that comes back (NEG-28), a reply is told from others. Where it does not, the
    request is of a kind of which as many replies were heard as were asked for, if there is one.
    """
    if by_id:
        return VIEWPORT_REQUEST | {"id": next(_ids)}

    def is_owed(request: Json) -> bool:
        kind = str(request["type"])
        asked = [message for message in said if message.get("type") == kind]
        return len(asked) > sum(_SIGNS[kind] in message for message in heard)

    return CAMERA_REQUEST if is_owed(VIEWPORT_REQUEST) else VIEWPORT_REQUEST


def both(by_id: bool) -> list[Json]:
    """Good requests, whose replies come behind any to what went before them.

    Where no id tells them, what was answered before may look like either: both, one behind the
    other, still come after it.
    """
    if by_id:
        return [one(by_id=True)]
    return [VIEWPORT_REQUEST, CAMERA_REQUEST]


def are_answered(requests: Sequence[Json], heard: Iterable[Json]) -> bool:
    """Whether a reply to each is among what was heard, in order."""
    left = iter(heard)
    return all(any(_replies(message, request) for message in left) for request in requests)


def _replies(message: Json, request: Json) -> bool:
    has_its_id = "id" not in request or message.get("id") == request["id"]
    return has_its_id and _SIGNS[request["type"]] in message


def next_pose() -> Json:
    """A camera where it has not been lately."""
    row, column = divmod(next(_places), 64)
    return camera_pose((STEP * column, STEP * (row % 64), -2.0))


def shows(frame: Json, pose: Json) -> bool:
    """Whether a frame says that its camera was where this pose put it."""
    position = finites(within(frame, "camera", "position"), 3)
    meant = pose["position"].values()
    return position is not None and all(
        abs(is_ - wanted) < STEP / 4 for is_, wanted in zip(position, meant, strict=True)
    )
