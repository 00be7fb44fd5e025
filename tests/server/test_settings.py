from __future__ import annotations

import pytest
from splatbus_server.settings import settings

VARIABLES = ("SPLATBUS_HOST", "SPLATBUS_IPC_PORT", "SPLATBUS_MSG_PORT", "SPLATBUS_TOKEN")


@pytest.fixture(autouse=True)
def bare_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)


def test_defaults_are_those_of_the_specification() -> None:
    """[SEC-1]"""
    assert settings() == ("127.0.0.1", 6001, 6000, None)


def test_the_environment_wins_over_defaults_and_arguments_over_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name, value in zip(VARIABLES, ("127.0.0.2", "7001", "7000", "secret"), strict=True):
        monkeypatch.setenv(name, value)
    assert settings() == ("127.0.0.2", 7001, 7000, "secret")
    assert settings("127.0.0.3", 0, 1, "other") == ("127.0.0.3", 0, 1, "other")


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1"])
def test_other_machines_need_a_token(host: str) -> None:
    """[NEG-17]"""
    with pytest.raises(ValueError, match=r"NEG-17"):
        settings(host)
    with pytest.raises(ValueError, match="16 characters can be guessed"):
        settings(host, token="fifteen letters")
    assert settings(host, token="sixteen letters!").token == "sixteen letters!"


@pytest.mark.parametrize("host", ["127.0.0.1", "127.9.9.9", "::1", "localhost"])
def test_a_token_among_oneself_may_be_short(host: str) -> None:
    assert settings(host, token="a") == (host, 6001, 6000, "a")


@pytest.mark.parametrize("port", [-1, 65536])
def test_a_port_has_its_range(port: int) -> None:
    with pytest.raises(ValueError, match="port"):
        settings(ipc_port=port)
