"""Good requests that show that a server goes on, and which of its answers are to these.

What went before may have been answered too, though it should not: such an answer must not be taken
for the control's.
"""

import itertools
from collections.abc import Iterable, Sequence

from splatbus_conformance.wire.messages import Json

VIEWPORT_REQUEST: Json = {"type": "get_viewport_size"}
CAMERA_REQUEST: Json = {"type": "get_camera_pose", "cam_idx": 0}
_SIGNS = {"get_viewport_size": "viewport_size", "get_camera_pose": "position"}
"""What only the reply to each has."""
_ids = itertools.count(2**30)
"""What no check gives a request of its own by chance."""


def one(by_id: bool) -> Json:
    """A good request: by its id, where that comes back (NEG-28), its reply is told from others."""
    return VIEWPORT_REQUEST | {"id": next(_ids)} if by_id else VIEWPORT_REQUEST


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
