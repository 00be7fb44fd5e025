"""Where the server is: arguments before the environment before the specification."""

import os

import pytest
from splatbus_wire.settings import read_token, settings

ENVIRONMENT = {
    "SPLATBUS_HOST": "renderer",
    "SPLATBUS_IPC_PORT": "7001",
    "SPLATBUS_MSG_PORT": "7000",
    "SPLATBUS_TOKEN": "from-environment",
}


@pytest.mark.parametrize(
    ("given", "environment", "found"),
    [
        ((), {}, ("127.0.0.1", 6001, 6000, None)),
        ((), ENVIRONMENT, ("renderer", 7001, 7000, "from-environment")),
        (("::1", 1, 2, "given"), ENVIRONMENT, ("::1", 1, 2, "given")),
    ],
)
def test_arguments_come_before_the_environment_and_that_before_defaults(given, environment, found):
    assert settings(*given, environment=environment) == found


def test_a_server_may_let_the_system_choose():
    assert settings(ipc_port=0, environment={}, least_port=0).ipc_port == 0


@pytest.mark.parametrize("port", ["0", "65536", "-1", "6001.0", "ipc", "٦٠٠١"])
def test_a_bad_port_is_refused_by_the_name_of_its_variable(port):
    with pytest.raises(ValueError, match="SPLATBUS_IPC_PORT"):
        settings(environment={"SPLATBUS_IPC_PORT": port})


@pytest.mark.parametrize(
    ("ports", "told"), [((70000, 1), "70000"), ((7, 7), "both channels have port 7: ")]
)
def test_a_bad_port_that_was_given_is_refused(ports, told):
    with pytest.raises(ValueError, match=told):
        settings(None, *ports, environment={})


@pytest.mark.parametrize("token", ["x" * 257, "caf\udce9"])
def test_a_token_that_no_hello_can_carry_is_refused(token):
    with pytest.raises(ValueError, match="NEG-2"):
        settings(environment={"SPLATBUS_TOKEN": token})


def test_a_token_is_read_without_the_space_around_it(tmp_path):
    path = tmp_path / "token"
    path.touch(0o600)
    path.write_text(" secret\n")
    assert read_token(path) == "secret"


@pytest.mark.skipif(os.name != "posix", reason="permissions are those of POSIX")
def test_a_token_that_others_can_read_is_refused(tmp_path):
    path = tmp_path / "token"
    path.write_text("secret")
    path.chmod(0o640)
    with pytest.raises(ValueError, match="chmod 600"):
        read_token(path)


@pytest.mark.parametrize(("held", "told"), [(b"", "no token"), (b"caf\xe9", "token is not UTF-8")])
def test_a_token_file_without_a_token_is_refused(tmp_path, held, told):
    path = tmp_path / "token"
    path.touch(0o600)
    path.write_bytes(held)
    with pytest.raises(ValueError, match=told):
        read_token(path)
