"""The command line: what it takes, and what it says when something is wrong."""

import pytest
from splatbus_viewer.cli import main


def test_help_teaches_the_environment(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    text = capsys.readouterr().out
    for name in ("SPLATBUS_HOST", "SPLATBUS_IPC_PORT", "SPLATBUS_MSG_PORT", "SPLATBUS_TOKEN"):
        assert name in text


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ([], "splatbus-server"),
        (["--camera-index", "0"], "no camera came within 0.3 s: no server at"),
        (["--pose", "-1,0,0,0,0,0,2"], "norm"),
    ],
)
@pytest.mark.usefixtures("where")
def test_a_picture_that_cannot_be_taken_says_why(server, options, problem, tmp_path, capsys):
    server.stop()
    path = tmp_path / "out.png"
    assert main(["snapshot", str(path), "--timeout", "0.3", *options]) == 1
    assert problem in capsys.readouterr().err
    assert not path.exists()


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["watch"],
        ["snapshot", "a.png", "--pose", "0,0,0,0,0,0,1", "--camera-index", "1"],
    ],
)
def test_wrong_usage_is_refused(arguments):
    with pytest.raises(SystemExit) as done:
        main(arguments)
    assert done.value.code == 2


def test_the_usage_of_the_command_and_a_name_that_is_near_are_told(capsys):
    with pytest.raises(SystemExit):
        main(["snapshot", "a.png", "--lookat", "0,0,0,0,0,1"])
    usage, _, told = capsys.readouterr().err.partition("error:")
    assert "splatbus-client snapshot" in usage
    assert "did you mean --look-at?" in told


def test_a_token_that_cannot_be_read_is_refused(capsys):
    assert main(["view", "--token-file", "/no/such/file"]) == 2
    assert "/no/such/file: No such file" in capsys.readouterr().err
