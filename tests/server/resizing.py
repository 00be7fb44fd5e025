"""Another size, asked for by a client."""

from typing import Any

from splatbus_schemas import LIMITS

from tests.server.stage import Client, Stage

LET_GO = LIMITS["let_go_seconds"]


def set_viewport(width: int = 8, height: int = 6, request: int = 12) -> dict[str, Any]:
    return {"type": "set_viewport", "width": width, "height": height, "id": request}


def change(stage: Stage, asker: Client, width: int = 8, height: int = 6) -> dict[str, Any]:
    """Asks, waits for the memory, and returns the reply."""
    asker.say(set_viewport(width, height))
    stage.do_chores()
    (reply,) = asker.hear()
    return reply


def answers(*generations: int) -> list[dict[str, Any]]:
    opened, *closed = generations
    return [
        {"type": "opened", "generation": opened},
        *({"type": "closed", "generation": each} for each in closed),
    ]
