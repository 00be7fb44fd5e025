"""The likeliest mistakes, made for real: what is printed says what happened and what to do."""

import contextlib
import os
import signal
import socket
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from splatbus_conformance.images.memory.host import PREFIX, HostMemory
from splatbus_conformance.plan import NoVerdict, Usage
from splatbus_conformance.trials.testee.process import Launched
from splatbus_conformance.wire.ports import free_port

from tests.conformance.harness import GOOD, LIMIT_SECONDS, broken, run, said, start
from tests.waiting import eventually

posix = pytest.mark.skipif(os.name != "posix", reason="signals and permissions of POSIX")
linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux shows it")
SLOT_BYTES = 20
"""Of a pixel."""


# A command that does not start


def complaint(command: str) -> str:
    """What is said of a command that cannot be started."""
    launched = Launched(command, {})
    try:
        with pytest.raises(NoVerdict) as caught:
            launched.ensure_running()
    finally:
        launched.close()
    return str(caught.value)


def test_quotes_that_do_not_match_are_a_usage_error() -> None:
    if os.name == "posix":
        with pytest.raises(Usage, match="quotation mark"):
            Launched('./viewer "scene.blend', {})


@posix
@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("/nowhere/my-viewer", "there is no such file"),
        ("my-viewer-that-is-nowhere", "no such program in the PATH"),
        ("cd build && ./my-viewer", "begin with sh -c"),
        ("DISPLAY=:0 ./my-viewer", "begin with env DISPLAY=:0"),
        ("~/my-viewer", "write the whole path"),
    ],
)
def test_a_command_that_does_not_start_says_why(command: str, words: str) -> None:
    told = complaint(command)
    assert "cannot start the testee" in told
    assert words in told


@posix
def test_files_that_are_no_programs_say_what_runs_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text, executable in (
        ("viewer.js", "", False),
        ("viewer", "", False),
        ("bare.sh", "echo hi\n", True),
        ("lost.py", "#!/no/such/python\n", True),
    ):
        path = tmp_path / name
        path.write_text(text, "utf-8")
        path.chmod(path.stat().st_mode | (stat.S_IXUSR if executable else 0))
    assert "begin the command with what runs it: node ./viewer.js" in complaint("./viewer.js")
    assert "chmod +x ./viewer" in complaint("./viewer")
    assert "sh ./bare.sh" in complaint("./bare.sh")
    assert "#!/no/such/python" in complaint("./lost.py")
    assert "it is a folder" in complaint(f"{tmp_path}/")
    assert "write ./bare.sh" in complaint("bare.sh")


# Nobody comes


def test_a_launcher_that_leaves_is_told_from_a_client_that_fails() -> None:
    code, output = said("client", "--launch", f'"{sys.executable}" -c pass')
    assert code == 3, output
    assert "the client ended with status 0" in output
    assert "name the real program" in output
    assert "SPLATBUS_IPC_PORT" in output


def test_whoever_starts_a_client_by_hand_is_asked_for_host_and_ports() -> None:
    ports = free_port(), free_port()
    place = f"{ports[0]},{ports[1]}"
    code, output = said("client", "--wait", "--ports", place, "--patience", "0.5")
    assert code == 3, output
    assert f"127.0.0.1:{ports[0]}" in output
    assert "--host 0.0.0.0" in output
    assert "firewall" in output
    assert "SPLATBUS_IPC_PORT" not in output, "nobody is told by them"


def test_a_server_that_is_not_there_is_told_by_what_the_system_says() -> None:
    ports = free_port(), free_port()
    code, output = said(
        "server", "--connect", "--ports", f"{ports[0]},{ports[1]}", "--patience", "0.5"
    )
    assert code == 3, output
    assert "refused" in output
    assert "Was the server started" in output


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


# The end of a run


@linux
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_leaves_no_process_and_no_memory_behind(
    tmp_path: Path, ending: signal.Signals
) -> None:
    """Not even of a client that a shell has started, as npm or a launcher would."""
    script, note = tmp_path / "client.sh", tmp_path / "pid"
    script.write_text(f"{GOOD} &\necho $! > {note}\nwait\n", "utf-8")
    harness = start("client", "--launch", f"sh {script}")
    try:
        assert harness.stdout is not None
        for line in harness.stdout:
            if "Met the client" in line:
                break
        memory = memory_of(harness.pid)
        client = int(note.read_text("utf-8"))
        assert memory
        assert runs(client)
        harness.send_signal(ending)
        output, _ = harness.communicate(timeout=LIMIT_SECONDS)
    finally:
        harness.kill()
        harness.communicate()
    assert harness.returncode == 130, output
    assert not [path for path in memory if path.exists()]
    assert eventually(lambda: not runs(client))


def memory_of(pid: int) -> list[Path]:
    """The shared memory that a process holds."""
    found = []
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # it was closed meanwhile
            found.append(link.readlink())
    return [path for path in found if path.name.startswith(PREFIX)]


def runs(pid: int) -> bool:
    """It has not ended, whether or not anybody has taken notice."""
    try:
        return Path(f"/proc/{pid}/stat").read_text("utf-8").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


# Where it is run


def test_a_console_without_utf_8_gets_its_report(tmp_path: Path) -> None:
    command = broken(tmp_path, ("if not 1 <= length <= LIMIT:", "if False:"))
    code, output = run(
        *("client", "--launch", command, "--select", "check_bad_length_closes"),
        *("--shrink", "0"),
        cwd=tmp_path,
        PYTHONIOENCODING="ascii",
    )
    assert code == 1, output
    assert "client ? server" in output
    assert "Traceback" not in output


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
    from splatbus_conformance.cases.script import Script, as_text
    from splatbus_conformance.plan import Plan
    from splatbus_conformance.run.failures import work_out
    from splatbus_conformance.verdicts import Level, Result, Verdict

    (tmp_path / "file").write_text("", "utf-8")
    plan = Plan("client", None, "127.0.0.1", (6001, 6000), (64, 48), 1.0)
    script = as_text(Script("client", "FRM-3", "check_x", False, (), "quick", (64, 48)))
    failed = Result("FRM-3", "check_x", Level.WIRE, Verdict.FAIL, "seen", script=script)
    told: list[str] = []
    assert work_out(plan, [failed], tmp_path / "file" / "folder", 0.0, told.append) == [failed]
    assert "--scripts names another folder" in told[0]


DIES = {
    "server": """
import os, socket
ports = [int(os.environ[f"SPLATBUS_{name}_PORT"]) for name in ("IPC", "MSG")]
ipc, msg = (socket.create_server(("127.0.0.1", port)) for port in ports)
msg.accept()
raise RuntimeError("no scene in /data")
""",
    "client": """
import os, socket
socket.create_connection(("127.0.0.1", int(os.environ["SPLATBUS_MSG_PORT"])))
raise RuntimeError("no scene in /data")
""",
}


@pytest.mark.parametrize(("side", "parallel"), [("client", "1"), ("server", "2")])
def test_a_testee_that_ends_after_it_was_met_is_quoted(
    side: str, parallel: str, tmp_path: Path
) -> None:
    (tmp_path / "dies.py").write_text(DIES[side], "utf-8")
    command = f'"{sys.executable}" "{tmp_path / "dies.py"}"'
    report = tmp_path / "report.json"
    code, output = run(
        *(side, "--launch", command, "--select", "BUF", "--patience", "2"),
        *("--parallel", parallel, "--json", str(report)),
    )
    assert code == 3, output
    assert f"the {side} ended with status 1" in output
    assert "RuntimeError: no scene in /data" in output
    assert "no scene in /data" in report.read_text("utf-8")
    if parallel == "1":
        last = output.strip().splitlines()[-2]
        assert last.startswith("no verdict: the client ended with status 1; 0 of")
