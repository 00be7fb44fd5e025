"""Good requests that show that a server goes on, and which of its answers are to these.

What went before may have been answered too, though it should not: such an answer must not be taken
for the control's.
"""

import itertools
from collections.abc import Iterable, Sequence

from splatbus_conformance.messages import Json
from splatbus_conformance.values import within

VIEWPORT_REQUEST: Json = {"type": "get_viewport_size"}
CAMERA_REQUEST: Json = {"type": "get_camera_pose", "cam_idx": 0}
_SIGNS = {"get_viewport_size": "viewport_size", "get_camera_pose": "position"}
"""What only the reply to each has."""
_ids = itertools.count(2**51)
"""What no check gives a request of its own by chance."""


def one(welcome: Json | None, request: Json = VIEWPORT_REQUEST) -> Json:
    """A good request on a connection with this `welcome`: by its id, where that comes back
    (NEG-28), its reply is told from all others.
    """
    speaks_1_1 = within(welcome, "version") == "1.1"
    return request | {"id": next(_ids)} if speaks_1_1 else request


def both(welcome: Json | None) -> list[Json]:
    """Good requests, whose replies come behind any to what went before them.

    Where no id tells them, what was answered before may look like either: both, one behind the
    other, still come after it.
    """
    if within(welcome, "version") == "1.1":
        return [one(welcome)]
    return [VIEWPORT_REQUEST, CAMERA_REQUEST]


def are_answered(requests: Sequence[Json], heard: Iterable[Json]) -> bool:
    """Whether a reply to each is among what was heard, in order."""
    left = iter(heard)
    return all(any(_replies(message, request) for message in left) for request in requests)


def _replies(message: Json, request: Json) -> bool:
    has_its_id = "id" not in request or message.get("id") == request["id"]
    return has_its_id and _SIGNS[request["type"]] in message
