"""Good requests to a server, and what it answers."""

from splatbus_conformance.trials.controls import CAMERA_REQUEST, VIEWPORT_REQUEST
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection


def every_request(trial: ServerTrial, connection: Connection) -> list[Json]:
    """A good request of each kind that this connection may send."""
    granted = trial.with_(connection).granted
    width, height = trial.facts.size
    by_capability: dict[str, Json] = {
        "scene": {"type": "get_scene"},
        "ping": {"type": "ping", "t": 12.5},
        "viewport": {"type": "set_viewport", "width": width, "height": height},
    }
    agreed = [request for name, request in by_capability.items() if name in granted]
    return [VIEWPORT_REQUEST, CAMERA_REQUEST, *(it for it in agreed if it.get("width") != 0)]


def replies_after(
    trial: ServerTrial, connection: Connection, before: int, count: int
) -> list[Json]:
    """What was answered past so many replies, once so many more have come, or none for a while."""

    def another(came: int) -> bool:
        trial.wait(lambda: len(trial.replies(connection)) > came or connection.ended)
        return len(trial.replies(connection)) > came

    while (came := len(trial.replies(connection))) < before + count and another(came):
        pass
    return trial.replies(connection)[before:]
