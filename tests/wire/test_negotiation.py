import hmac

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_wire.messages import ErrorMessage, Hello, Program, Welcome
from splatbus_wire.negotiation import answer_hello

SERVER = Program("example", "0.1")
CAPABILITIES = ("host_shm", "frames", "reinit")
name_lists = st.lists(st.text(max_size=3), unique=True, max_size=6)


def hello(**change) -> Hello:
    return Hello(("1.1", "1.0"), Program("viewer", "2"), ("host_shm", "frames"))._replace(**change)


def answer(
    message: Hello, *, versions=("1.1", "1.0"), capabilities=CAPABILITIES, token=None
) -> Welcome | ErrorMessage:
    return answer_hello(
        message, versions=versions, capabilities=capabilities, server=SERVER, token=token
    )


@pytest.mark.parametrize(
    ("wanted", "spoken", "chosen"),
    [
        (("1.1", "1.0"), ("1.0", "1.1"), "1.1"),
        (("1.0", "1.1"), ("1.1", "1.0"), "1.0"),
        (("1.2", "1.1"), ("1.1",), "1.1"),
    ],
)
def test_the_version_is_the_first_of_the_client_that_the_server_speaks(wanted, spoken, chosen):
    welcome = answer(hello(versions=wanted), versions=spoken)
    assert isinstance(welcome, Welcome)
    assert (welcome.version, welcome.server) == (chosen, SERVER)


@given(name_lists, name_lists, st.sampled_from(["1.0", "1.1"]))
def test_the_capabilities_are_those_that_both_have_and_none_of_1_0(asked, offered, version):
    welcome = answer(hello(versions=(version,), capabilities=asked), capabilities=offered)
    shared = set(asked) & set(offered) if version == "1.1" else set()
    assert set(welcome.capabilities) == shared
    assert len(welcome.capabilities) == len(shared)


def test_with_no_common_version_the_server_says_what_it_speaks():
    error = answer(hello(versions=("2.0",)))
    assert isinstance(error, ErrorMessage)
    assert (error.code, error.supported) == ("unsupported_version", ("1.1", "1.0"))


@pytest.mark.parametrize("token", [None, "", "secre", "secret!", "Secret", "sécret"])
def test_a_missing_or_other_token_is_unauthorized_and_learns_nothing(token):
    for versions in (("1.1",), ("2.0",)):
        error = answer(hello(token=token, versions=versions), token="secret")
        assert isinstance(error, ErrorMessage)
        assert (error.code, error.supported, error.pointer) == ("unauthorized", None, None)
        assert "secret" not in error.message


@pytest.mark.parametrize(
    ("given", "required"), [("secret", "secret"), ("sécret", "sécret"), ("anything", None)]
)
def test_the_right_token_is_welcome_and_any_where_none_is_required(given, required):
    assert isinstance(answer(hello(token=given), token=required), Welcome)


def test_tokens_are_compared_in_constant_time(monkeypatch):
    compared = []
    monkeypatch.setattr(hmac, "compare_digest", lambda a, b: compared.append((a, b)) or a == b)
    answer(hello(token="other"), token="sécret")
    assert compared == [(b"other", "sécret".encode())]
