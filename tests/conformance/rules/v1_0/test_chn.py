"""Every rule on who sends what on which channel, kept and broken."""

from tests.conformance.rules.talk import (
    ADDED,
    ALL,
    CUDA_INIT,
    HOST_INIT,
    INIT,
    POSE,
    Case,
    Step,
    breaches,
    client,
    first_breach,
    greeting,
    hello,
    server,
    session,
    talk,
    welcome,
)


def ipc(*steps: Step) -> list:
    return talk("ipc", *steps)


CASES = [
    Case("CHN-4", "server", ipc(server(INIT)), ipc(server({"type": "news"}), server(INIT))),
    Case("CHN-6", "client", ipc(server(INIT)), ipc(server(INIT), client({"type": "opened"}))),
    Case("CHN-8", "server", ipc(server(INIT)), ipc(server(INIT), server(INIT))),
    Case(
        "NEG-11",
        "server",
        session(),
        ipc(*greeting("frames"), server(HOST_INIT)),
    ),
]


def test_host_memory_on_a_connection_of_1_0_breaks_chn_5() -> None:
    assert breaches(ipc(server(HOST_INIT))) == {("server", "CHN-5"): 1}
    assert breaches(ipc(server(CUDA_INIT))) == {}


def test_host_memory_before_hello_breaks_neg_11() -> None:
    too_early = ipc(server(HOST_INIT), *greeting(*ALL))
    assert breaches(too_early) == {("server", "NEG-11"): 1}
    assert first_breach(too_early).pointer == "/memory/kind"


def test_host_memory_for_a_hello_that_cannot_be_read_is_not_judged() -> None:
    unreadable = {**hello(), "capabilities": "host_shm"}
    found = breaches(ipc(client(unreadable), server(welcome()), server(HOST_INIT)))
    assert found == {("client", "NEG-2"): 1}


def test_cuda_memory_may_be_announced_at_once_and_named_in_hello_later() -> None:
    assert breaches(ipc(server(CUDA_INIT), *greeting("cuda_ipc"))) == {}


def test_after_hello_other_packets_may_follow() -> None:
    vendors = session(server({"type": "x-example-note"}), capabilities=[*ALL, "x-example-notes"])
    assert breaches(vendors) == {}


def test_every_message_of_a_client_without_hello_is_a_breach() -> None:
    talkative = ipc(client(POSE), client({"type": "release"}), server(INIT))
    assert breaches(talkative) == {("client", "CHN-6"): 2}


def test_the_members_of_1_1_make_no_difference_to_a_silent_client() -> None:
    assert breaches(ipc(server({**CUDA_INIT, **ADDED}))) == {}
