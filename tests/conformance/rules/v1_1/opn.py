"""Opening and closing."""

from tests.conformance.rules.talk import (
    ALL,
    CLIENT_ENDS,
    CUDA_INIT,
    HOST_INIT,
    OPENED,
    Step,
    about_generation,
    changed,
    client,
    greeting,
    ipc,
    raw,
    server,
    session,
)

ANNOUNCED = server(HOST_INIT)
SECOND, THIRD = (server({**HOST_INIT, "generation": n}) for n in (2, 3))
OPENED_2, OPENED_3 = (client(about_generation("opened", n)) for n in (2, 3))
CLOSED = client(about_generation("closed"))
FAILED = client(about_generation("open_failed", reason="no such memory"))
SUBSCRIBES = client({"type": "subscribe", "channels": ["color"]})
WITHOUT_REINIT = [name for name in ALL if name != "reinit"]
AGAIN = server({**HOST_INIT, "semantics": None})


def answered(*answers: Step, to: Step = ANNOUNCED) -> list:
    return ipc(*greeting(*ALL), to, *answers)


def of(generation: object) -> list[Step]:
    """Both answers to it."""
    kinds = ("opened", "open_failed")
    answers = (about_generation(kind, reason="no") for kind in kinds)
    return [client(changed(it, "/generation", generation)) for it in answers]


BAD: dict[str, tuple[object, str]] = {
    "generation": ("one", "MEM-1"),
    "meta": (None, "INI-1"),
}


TALKS = {
    "opened and closed": (session(SECOND, OPENED_2, CLOSED), ""),
    "not opened": (answered(FAILED), ""),
    "opened twice": (session(OPENED), "OPN-1"),
    "opened, and not opened": (session(FAILED), "OPN-1"),
    "closed too early": (session(SECOND, CLOSED, OPENED_2), "OPN-5"),
    "closed twice": (session(SECOND, OPENED_2, CLOSED, CLOSED), "OPN-11"),
    "closed, and never opened": (answered(FAILED, SECOND, OPENED_2, CLOSED), "OPN-11"),
    "a generation of nobody": (
        session(OPENED_2, client(about_generation("closed", 2))),
        "OPN-11 OPN-11",
    ),
    "no generation": (answered(client({"type": "opened"})), "OPN-13"),
    "without reinit": (session(SECOND, SUBSCRIBES, capabilities=WITHOUT_REINIT), "OPN-7"),
    "without reinit, and answered": (
        session(SECOND, OPENED_2, capabilities=WITHOUT_REINIT),
        "OPN-6 OPN-7",
    ),
    "the first good one is no further one": (
        ipc(
            *greeting(*WITHOUT_REINIT),
            *(server({**HOST_INIT, "ring": None}), SECOND, OPENED_2, SUBSCRIBES),
        ),
        "MEM-8 OPN-7",
    ),
    "a generation that comes again": (session(AGAIN), "MEM-1 MEM-12"),
    "one that comes again is opened": (session(AGAIN, OPENED), "MEM-1 MEM-12 OPN-11"),
    "passed over": (answered(SECOND, OPENED_2), ""),
    "passed over to the end": (answered(SECOND, OPENED_2, CLIENT_ENDS), "OPN-1"),
    "announced before welcome": (ipc(server(CUDA_INIT), *greeting("cuda_ipc"), OPENED), ""),
    "what could not be split": (answered(raw("s2c", b"\xff" * 8), CLOSED, OPENED), "server:FRM-2"),
    "announced again in time": (
        session(SECOND, OPENED_2, server(HOST_INIT), THIRD, CLOSED, OPENED_3),
        "MEM-1",
    ),
    **{
        f"of a bad {member}, {count} answers": (
            answered(*answers, CLIENT_ENDS, to=server({**HOST_INIT, member: value})),
            " ".join([broken, *["OPN-11"] * (count > 1)]),
        )
        for member, (value, broken) in BAD.items()
        for count in range(3)
        for answers in [of(value if member == "generation" else 1)[:count]]
    },
}
