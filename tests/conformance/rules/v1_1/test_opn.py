"""Every rule on opening and closing, kept and broken."""

from typing import Any

import pytest

from tests.conformance.rules.talk import (
    ALL,
    CLIENT_ENDS,
    CUDA_INIT,
    HOST_INIT,
    OPENED,
    Case,
    Step,
    about_generation,
    breaches,
    changed,
    client,
    greeting,
    raw,
    server,
    session,
    talk,
)

SECOND = server({**HOST_INIT, "generation": 2})
OPENED_2 = client(about_generation("opened", 2))
CLOSED = client(about_generation("closed"))
WITHOUT_REINIT = [name for name in ALL if name != "reinit"]


def failed(reason: Any = "no such memory") -> Step:
    return client(about_generation("open_failed", reason=reason))


def answered(*answers: Step) -> list:
    return talk("ipc", *greeting(*ALL), server(HOST_INIT), *answers)


KEPT = session(SECOND, OPENED_2, CLOSED)
IGNORED = session(
    SECOND, client({"type": "subscribe", "channels": ["color"]}), capabilities=WITHOUT_REINIT
)
CASES = [
    Case("OPN-1", "client", KEPT, session(OPENED)),
    Case("OPN-13", "client", KEPT, answered(client({"type": "opened"}))),
    Case("OPN-3", "client", answered(failed()), answered(failed(""))),
    Case("OPN-5", "client", KEPT, session(SECOND, CLOSED, OPENED_2)),
    Case("OPN-7", "server", KEPT, session(SECOND, capabilities=WITHOUT_REINIT)),
    Case("OPN-11", "client", KEPT, session(OPENED_2)),
]


def test_an_answer_to_what_must_be_ignored_breaks_opn_6() -> None:
    assert breaches(IGNORED) == {("server", "OPN-7"): 1}
    obliging = session(SECOND, OPENED_2, capabilities=WITHOUT_REINIT)
    assert breaches(obliging) == {("server", "OPN-7"): 1, ("client", "OPN-6"): 1}


def test_after_rubbish_the_first_good_init_packet_is_no_further_one() -> None:
    bad = server({**HOST_INIT, "ring": None})
    found = breaches(
        talk("ipc", *greeting(*WITHOUT_REINIT), bad, SECOND, OPENED_2, client({"type": "hello"}))
    )
    assert not {("client", name) for name in ("OPN-1", "OPN-6", "OPN-11")} & set(found)


def test_opened_and_open_failed_is_one_answer_too_many() -> None:
    assert breaches(session(failed())) == {("client", "OPN-1"): 1}


@pytest.mark.parametrize("kind", ["opened", "open_failed"])
def test_what_repeats_a_generation_is_not_answered(kind: str) -> None:
    again = server({**HOST_INIT, "semantics": None})
    wrong = session(again, client(about_generation(kind, reason="no")))
    assert breaches(session(again)) == {("server", "MEM-1"): 1, ("server", "MEM-12"): 1}
    assert breaches(wrong)["client", "OPN-11"] == 1


def test_what_was_opened_is_closed_once() -> None:
    closed_again = session(SECOND, OPENED_2, CLOSED, CLOSED)
    assert breaches(closed_again)["client", "OPN-11"] == 1
    never_opened = answered(failed(), SECOND, OPENED_2, CLOSED)
    assert breaches(never_opened) == {("client", "OPN-11"): 1}


@pytest.mark.parametrize("kind", ["opened", "open_failed", "closed"])
def test_a_generation_that_was_never_announced_breaks_opn_11(kind: str) -> None:
    wrong = about_generation(kind, 2, reason="no")
    assert breaches(answered(client(wrong))) == {("client", "OPN-11"): 1}


def test_a_generation_as_a_string_breaks_jsn_4_alone() -> None:
    as_text = changed(about_generation("opened"), "/generation", "1")
    assert breaches(answered(client(as_text))) == {("client", "JSN-4"): 1}


def test_an_init_packet_passed_over_shows_at_the_end() -> None:
    steps = (*greeting(*ALL), server(HOST_INIT), SECOND, OPENED_2)
    assert breaches(talk("ipc", *steps)) == {}
    assert breaches(talk("ipc", *steps, CLIENT_ENDS)) == {("client", "OPN-1"): 1}


def test_memory_announced_before_welcome_is_answered_after_it() -> None:
    assert breaches(talk("ipc", server(CUDA_INIT), *greeting("cuda_ipc"), OPENED)) == {}


@pytest.mark.parametrize(
    "spoil",
    [
        {"generation": "1"},
        {"generation": "one"},
        {"version": "9.9"},
        {"meta": None},
        {"memory": {"kind": "host_shm", "name": "../x", "bytes": 1}},
        {"mem_color": "x"},
    ],
)
def test_a_client_may_answer_a_bad_init_packet_or_not(spoil: dict) -> None:
    bad = server({**HOST_INIT, **spoil})
    generation = spoil.get("generation", 1)
    answer = client(changed(about_generation("opened"), "/generation", generation))
    refusal = client(about_generation("open_failed", generation, reason="no"))
    for answers in ((), (answer,), (refusal,), (answer, refusal)):
        steps = (*greeting(*ALL), bad, *answers, CLIENT_ENDS)
        found = {name for peer, name in breaches(talk("ipc", *steps)) if peer == "client"}
        twice = {"OPN-11"} if len(answers) > 1 else set()
        assert found - {"JSN-4"} == twice


def test_nothing_is_said_of_answers_to_what_could_not_be_split() -> None:
    steps = (*greeting(*ALL), raw("s2c", b"\xff" * 8), OPENED, CLOSED)
    assert not any(peer == "client" for peer, _ in breaches(talk("ipc", *steps)))


def test_memory_closed_in_time_may_be_announced_again_before_that_is_heard() -> None:
    third = server({**HOST_INIT, "generation": 3})
    again = server(HOST_INIT)
    steps = (SECOND, OPENED_2, again, third, CLOSED, client(about_generation("opened", 3)))
    assert breaches(session(*steps)).keys() <= {("server", "MEM-1")}
