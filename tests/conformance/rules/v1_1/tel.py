"""Telemetry."""

from tests.conformance.rules.talk import (
    ASK_SIZE,
    SIZE,
    TELEMETRY,
    Step,
    client,
    greeting,
    msg,
    server,
)

NAMES = [series["name"] for series in TELEMETRY["series"]]
ASKED, ANSWERED = client(ASK_SIZE), server({"type": "viewport_size", **SIZE})
TOLD, AGAIN = (server({**TELEMETRY, "seq": seq}) for seq in (17, 18))
HISTOGRAM = {"name": "h", "kind": "histogram"}


def wishes(names: object) -> Step:
    return client({"type": "subscribe_telemetry", "names": names})


def agreed(*steps: Step) -> list:
    return msg(*greeting("telemetry"), *steps)


def counted(edges: list, counts: list) -> list:
    series = [{**HISTOGRAM, "edges": edges, "counts": counts}]
    return agreed(wishes(None), server({**TELEMETRY, "series": series}))


TALKS = {
    "all series": (agreed(wishes(None), TOLD, AGAIN), ""),
    "these series": (agreed(wishes(NAMES), TOLD), ""),
    "other series": (agreed(wishes(NAMES[1:]), TOLD), "TEL-3"),
    "not growing": (agreed(wishes(None), TOLD, TOLD), "TEL-2"),
    "edges that fall": (counted([0, 1, 1], [1, 2]), "TEL-2"),
    "a count too many": (counted([0, 1], [1, 2]), "TEL-2"),
    "before any": (agreed(TOLD), "TEL-3"),
    "fewer": (agreed(wishes(None), wishes(NAMES[:2]), ASKED, ANSWERED, TOLD), "TEL-3"),
    "too early": (agreed(ASKED, ANSWERED, TOLD, wishes(None)), "TEL-3"),
    "on its way": (agreed(wishes(None), wishes([]), TOLD), ""),
    "after the request": (agreed(wishes(None), ASKED, wishes([]), ANSWERED, TOLD), ""),
    "either of two": (agreed(wishes(NAMES[:1]), wishes(NAMES[1:]), TOLD), ""),
    "not agreed": (msg(*greeting(), wishes(None), TOLD), "NEG-5 TEL-3"),
    "a broken wish": (agreed(wishes("all"), TOLD), "TEL-1"),
}
