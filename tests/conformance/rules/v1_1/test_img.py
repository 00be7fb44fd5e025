"""Every rule on frames, their release, and subscriptions, kept and broken."""

from typing import Any

import pytest

from tests.conformance.rules.talk import (
    ALL,
    HOST_INIT,
    Case,
    Step,
    about_generation,
    breaches,
    changed,
    client,
    frame,
    greeting,
    raw,
    server,
    session,
    talk,
)


def release(seq: int = 1, generation: int = 1) -> Step:
    return client(about_generation("release", generation, seq=seq))


def subscribe(channels: Any) -> list:
    return session(client({"type": "subscribe", "channels": channels}))


def lends(message: dict) -> list:
    return session(server(message))


FIRST = server(frame(1))
KEPT = session(FIRST, release(1), server(frame(4)), release(4))

CASES = [
    Case("IMG-1", "server", KEPT, session(FIRST, release(1), server(frame(1)))),
    Case("IMG-2", "server", KEPT, session(FIRST, server(frame(2)))),
    Case(
        "IMG-23",
        "server",
        KEPT,
        talk(
            "ipc",
            *greeting("host_shm"),
            server(HOST_INIT),
            client(about_generation("opened")),
            FIRST,
        ),
    ),
    Case("IMG-12", "client", KEPT, session(FIRST, release(1), release(1))),
    Case("IMG-19", "client", subscribe(["color"]), subscribe(["colour"])),
]


@pytest.mark.parametrize("pointer", ["/seq", "/slot", "/camera/fx", "/camera/position/0", "/time"])
def test_numbers_as_strings_break_jsn_4_alone(pointer: str) -> None:
    assert breaches(lends(changed(frame(), pointer, "2"))) == {("server", "JSN-4"): 1}


def test_a_frame_of_memory_that_is_not_open_breaks_img_2() -> None:
    early = talk("ipc", *greeting(*ALL), server(HOST_INIT), FIRST)
    assert breaches(early) == {("server", "IMG-2"): 1}
    other = session(server(frame(generation=2)))
    assert breaches(other) == {("server", "IMG-2"): 1}


def test_a_release_of_another_image_frees_nothing() -> None:
    wrong = session(FIRST, release(2), server(frame(3)))
    assert breaches(wrong) == {("client", "IMG-12"): 1, ("server", "IMG-2"): 1}


SECOND = {**HOST_INIT, "generation": 2}
ANNOUNCED, OPENED_2 = server(SECOND), client(about_generation("opened", 2))
CLOSED = client(about_generation("closed"))


def test_img_12_wants_the_release_before_closed() -> None:
    kept = session(FIRST, ANNOUNCED, OPENED_2, release(1), CLOSED)
    assert breaches(kept) == {}
    assert breaches(session(FIRST, ANNOUNCED, OPENED_2, CLOSED)) == {("client", "IMG-12"): 1}
    late = session(ANNOUNCED, OPENED_2, FIRST, CLOSED, release(1))
    assert breaches(late) == {("client", "IMG-12"): 1}


@pytest.mark.parametrize(
    "steps",
    [
        (ANNOUNCED, FIRST, OPENED_2, CLOSED),
        (server({**frame(), "slot": 3}), ANNOUNCED, OPENED_2, CLOSED),
        (ANNOUNCED, OPENED_2, CLOSED, FIRST),
    ],
    ids=["on its way", "of no slot", "after it"],
)
def test_img_12_does_not_ask_for_what_the_client_ignores(steps: tuple[Step, ...]) -> None:
    assert not any(peer == "client" for peer, _ in breaches(session(*steps)))


@pytest.mark.parametrize("kind", ["closed", "open_failed"])
def test_a_lease_ends_with_its_memory(kind: str) -> None:
    steps = (FIRST, ANNOUNCED, OPENED_2, client(about_generation(kind, reason="no")))
    found = breaches(session(*steps, server(frame(2, 2))))
    assert not any(peer == "server" for peer, _ in found)


def test_a_frame_that_crossed_closed_lends_nothing() -> None:
    crossing = (ANNOUNCED, OPENED_2, CLOSED, FIRST, server(frame(2, 2)))
    assert breaches(session(*crossing)) == {}


@pytest.mark.parametrize("member", ["seq", "generation"])
def test_img_12_wants_both_members(member: str) -> None:
    incomplete = changed(about_generation("release", seq=1), f"/{member}")
    assert breaches(session(FIRST, client(incomplete))) == {("client", "IMG-12"): 1}


def test_a_lease_held_to_the_end_is_no_breach() -> None:
    assert breaches(session(FIRST)) == {}


def test_a_client_may_release_what_the_server_lends_wrongly() -> None:
    twice = session(FIRST, FIRST, release(1), release(1))
    assert {peer for peer, _ in breaches(twice)} == {"server"}
    nameless = changed(frame(), "/seq", "first")
    answer = client(changed(about_generation("release", seq=1), "/seq", "first"))
    assert {peer for peer, _ in breaches(session(server(nameless), answer))} == {"server"}
    unsplit = session(raw("s2c", b"\xff" * 8), release(1))
    assert not any(peer == "client" for peer, _ in breaches(unsplit))


@pytest.mark.parametrize("channels", [["color"], ["depth"], ["depth", "color"]])
def test_img_19_takes(channels: Any) -> None:
    assert breaches(subscribe(channels)) == {}
