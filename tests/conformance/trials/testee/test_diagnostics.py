"""The likeliest mistakes, made for real: what is printed says what happened and what to do."""

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from splatbus_conformance.cases.script import Script, as_text
from splatbus_conformance.images.memory.host import PREFIX, HostMemory
from splatbus_conformance.plan import NoVerdict, Plan, Usage
from splatbus_conformance.run.failures import work_out
from splatbus_conformance.trials.testee.process import Launched
from splatbus_conformance.verdicts import Level, Result, Verdict
from splatbus_conformance.wire.ports import free_port

from tests.conformance.harness import GOOD, LIMIT_SECONDS, run, said

posix = pytest.mark.skipif(os.name != "posix", reason="signals and permissions of POSIX")
linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux shows it")
SLOT_BYTES = 20
"""Of a pixel."""


# A command that does not start


@posix
@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("/nowhere/my-viewer", "there is no such file"),
        ("my-viewer-that-is-nowhere", "no such program in the PATH"),
        ("cd build && ./my-viewer", "begin with sh -c"),
        ("DISPLAY=:0 ./my-viewer", "begin with env DISPLAY=:0"),
        ("~/my-viewer", "write the whole path"),
        ("./viewer.js", "begin the command with what runs it: node ./viewer.js"),
        ("./viewer", "chmod +x ./viewer"),
        ("./bare.sh", "sh ./bare.sh"),
        ("./lost.py", "#!/no/such/python"),
        ("./", "it is a folder"),
        ("bare.sh", "write ./bare.sh"),
    ],
)
def test_a_command_that_does_not_start_says_why(
    command: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    texts = {"viewer.js": "", "viewer": "", "bare.sh": "echo\n", "lost.py": "#!/no/such/python\n"}
    for name, text in texts.items():
        (tmp_path / name).write_text(text, "utf-8")
        (tmp_path / name).chmod(0o700 if text else 0o600)
    launched = Launched(command, {})
    with pytest.raises(NoVerdict, match="cannot start the testee") as caught:
        launched.ensure_running()
    launched.close()
    assert words in str(caught.value)
    with pytest.raises(Usage, match="quotation mark"):
        Launched('./viewer "scene.blend', {})


# Nobody comes


def two_ports() -> str:
    return f"{free_port()},{free_port()}"


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (
            ["client", "--launch", f'"{sys.executable}" -c pass'],
            ["the client ended with status 0", "name the real program", "SPLATBUS_IPC_PORT"],
        ),
        (
            ["client", "--wait", "--ports", two_ports(), "--patience", "0.5"],
            ["127.0.0.1:", "--host 0.0.0.0", "firewall"],
        ),
        (
            ["server", "--connect", "--ports", two_ports(), "--patience", "0.5"],
            ["refused", "Was the server started"],
        ),
    ],
)
def test_where_nobody_comes_it_is_said_what_to_look_at(words: list[str], parts: list[str]) -> None:
    code, output = said(*words)
    assert code == 3, output
    assert not [part for part in parts if part not in output], output
    told_by_them = "SPLATBUS_IPC_PORT" in output
    assert told_by_them is ("--launch" in words)


# Ports


@linux
def test_a_port_in_use_is_told_with_the_process_that_has_it() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, output = said("client", "--wait", "--ports", f"{free_port()},{port}")
    assert code == 2, output
    assert f"cannot listen on 127.0.0.1:{port} for the message channel" in output
    assert f"process {os.getpid()}" in output
    assert "--ports" in output


def test_a_host_that_is_elsewhere_is_told_from_a_port_in_use() -> None:
    code, output = said("client", "--launch", GOOD, "--host", "192.0.2.1")
    assert code == 2, output
    assert "192.0.2.1 is no address of this machine" in output


# Shared memory


@linux
def test_too_little_shared_memory_is_told_before_anybody_dies_of_it() -> None:
    size = os.statvfs("/dev/shm")
    pixels = 32768 * 32768
    if 3 * SLOT_BYTES * pixels <= size.f_blocks * size.f_frsize:
        pytest.skip("there is room for the largest images")
    code, output = said("client", "--launch", GOOD, "--viewport", "32768x32768")
    assert code == 3, output
    assert "No space left on device" in output
    assert "--shm-size=" in output
    assert "Traceback" not in output
    with pytest.raises(OSError, match="No space"):
        HostMemory(3 * SLOT_BYTES * pixels, f"{PREFIX}too-large")
    assert not Path(f"/dev/shm/{PREFIX}too-large").exists()


# Where it is run


@pytest.mark.parametrize("parallel", ["1", "2"])
def test_modules_of_the_users_folder_have_no_part_in_it(tmp_path: Path, parallel: str) -> None:
    for name in ("json", "random", "select", "queue", "xdist", "conftest"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('mine was imported')", "utf-8")
    done = subprocess.run(
        [
            *(sys.executable, "-P", "-m", "splatbus_conformance", "--plain", "client"),
            *("--launch", GOOD.replace(sys.executable, f'{sys.executable}" "-P'), "--select"),
            *("check_ignores_unknown_capabilities", "--parallel", parallel),
        ],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=LIMIT_SECONDS,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_failures_that_cannot_be_written_down_are_told_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    plan = Plan("client", None, "127.0.0.1", (6001, 6000), (64, 48), 1.0)
    script = as_text(Script("client", "FRM-3", "check_x", False, (), "quick", (64, 48)))
    failed = Result("FRM-3", "check_x", Level.WIRE, Verdict.FAIL, "seen", script=script)
    told: list[str] = []
    assert work_out(plan, [failed], tmp_path / "file" / "folder", 0.0, told.append) == [failed]
    assert "--scripts names another folder" in told[0]


DIES = """
import os, socket
ports = [int(os.environ[f"SPLATBUS_{name}_PORT"]) for name in ("IPC", "MSG")]
ipc, msg = (socket.create_server(("127.0.0.1", port)) for port in ports)
msg.accept()
raise RuntimeError("no scene in /data")
"""


@pytest.mark.parametrize("parallel", ["1", "2"])
def test_a_testee_that_ends_after_it_was_met_is_quoted(parallel: str, tmp_path: Path) -> None:
    (tmp_path / "dies.py").write_text(DIES, "utf-8")
    command, report = f'"{sys.executable}" "{tmp_path / "dies.py"}"', tmp_path / "report.json"
    code, output = run(
        *("server", "--launch", command, "--select", "BUF", "--patience", "2"),
        *("--parallel", parallel, "--json", str(report)),
    )
    assert code == 3, output
    assert "the server ended with status 1" in output
    for told in (output, report.read_text("utf-8")):
        assert "RuntimeError: no scene in /data" in told
