"""Mistakes that keep a run from beginning: what was seen, in, and what to do about it, out.

Functions from values to text; whoever has the values calls them.
"""

import errno
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

SHELL_ALONE = frozenset({"&&", "||", "|", ";", ">", ">>", "<", "&", "2>&1"})
SHELL_COMMANDS = frozenset({"cd", "export", "source", "set", "ulimit", "."})
INTERPRETERS = {".py": "python", ".js": "node", ".mjs": "node", ".sh": "sh", ".jar": "java -jar"}
NO_SUCH_PROGRAM, NO_PROGRAM = 127, 126
"""Statuses with which a shell ends that could not start what it was to start."""
NOT_FOR_THIS_MACHINE = (errno.ENOEXEC, 193)
"""193 is ERROR_BAD_EXE_FORMAT of Windows."""
MEBIBYTE = 1 << 20


class File(NamedTuple):
    """What is where a command says that its program is."""

    exists: bool
    folder: bool = False
    first_line: str = ""
    here: bool = False
    """There is a file of that name in the working directory, though not in the PATH."""


def bad_quotes(line: str, error: ValueError) -> str:
    """A command line that cannot be taken apart."""
    return f"the command {line} cannot be read ({error}): a quotation mark may be missing its twin"


def not_started(argv: Sequence[str], error: OSError, file: File, folder: Path) -> str:
    """Why a command does not start, and what to do.

    Args:
        argv: the command, taken apart.
        error: what the system said.
        file: what is there.
        folder: the working directory.
    """
    program = argv[0] if argv else ""
    return f"cannot start the testee: {program}: {_why_not(argv, program, error, file, folder)}"


def _why_not(argv: Sequence[str], program: str, error: OSError, file: File, folder: Path) -> str:
    if not file.exists and (shell := _takes_a_shell(argv)):
        return shell
    if program.startswith("~"):
        return "~ is spelled out by a shell, and none reads this: write the whole path"
    if isinstance(error, FileNotFoundError) and file.first_line.startswith("#!"):
        return f"it is a script, and the program of its first line is missing: {file.first_line}"
    if isinstance(error, FileNotFoundError):
        if file.here:
            return f"it is not in the PATH, but there is one in {folder}: write ./{program}"
        if "/" in program or "\\" in program:
            return f"there is no such file, seen from {folder}"
        return "there is no such program in the PATH; write its path, such as ./my-viewer"
    if isinstance(error, PermissionError):
        if file.folder:
            return "it is a folder; name the program in it"
        return f"it is not executable: {_made_executable(program)}"
    if error.errno in NOT_FOR_THIS_MACHINE or getattr(error, "winerror", 0) in NOT_FOR_THIS_MACHINE:
        return f"it is no program for this machine; if it is a script: {_made_executable(program)}"
    return str(error)


def _made_executable(program: str) -> str:
    interpreter = INTERPRETERS.get(Path(program).suffix.lower())
    begun = f"begin the command with what runs it: {interpreter or 'python'} {program}"
    return begun if sys.platform == "win32" or interpreter else f"chmod +x {program}, or {begun}"


def _takes_a_shell(argv: Sequence[str]) -> str:
    """That something in a command means something to shells only; nothing if nothing does."""
    odd = [it for it in argv if it in SHELL_ALONE]
    if argv and argv[0] in SHELL_COMMANDS:
        odd.insert(0, argv[0])
    if argv and "=" in argv[0]:
        return f"{argv[0]} is for a shell, and none reads this: begin with env {argv[0]}"
    if odd:
        return f"{odd[0]} is for a shell, and none reads this: begin with sh -c, and quote the rest"
    return ""


def port_refused(host: str, port: int, channel: str, error: OSError, holder: str) -> str:
    """Why the harness cannot listen, and what to do (a `holder` is known on Linux only)."""
    said = f"cannot listen on {host}:{port} for the {channel} channel"
    if error.errno == errno.EADDRINUSE or getattr(error, "winerror", 0) == 10048:
        who = f"{holder} has it" if holder else "another program has it"
        return (
            f"{said}: {who}. A renderer, or an earlier run, may still be going: end it; or name "
            "two other ports with --ports, the same that your client uses; without --ports, what "
            "is launched is given free ones"
        )
    if error.errno in (errno.EACCES, errno.EPERM):
        return f"{said}: it is not permitted ({error.strerror}); ports from 1024 on are free to all"
    return (
        f"{said}: {host} is no address of this machine ({_reason(error)}). Use --host 127.0.0.1 for"
        " a client on this machine, or --host 0.0.0.0 for one on another"
    )


def _reason(error: OSError) -> str:
    """What the system said, without the address that Python adds to it."""
    return (error.strerror or str(error)).partition(" (while")[0]


def no_shared_memory(error: OSError, needed: int, free: int | None, size: tuple[int, int]) -> str:
    """Why there is no memory to share with a client, and what to do.

    Args:
        error: what the system said.
        needed: bytes.
        free: bytes that are left where it was to be; None if there is no such place.
        size: of the images, width and height.
    """
    width, height = size
    said = (
        f"cannot make {_bytes(needed)} of shared memory, for images of {width}x{height} "
        f"({_reason(error)})"
    )
    if sys.platform != "linux":
        return said
    if free is None:
        return f"{said}: there is no /dev/shm here; mount one: mount -t tmpfs tmpfs /dev/shm"
    if error.errno == errno.ENOSPC:
        docker = max(256, 2 * -(-needed // MEBIBYTE))
        return (
            f"{said}: {_bytes(free)} are left in /dev/shm. A container has 64 MiB unless it is "
            f"started with more (docker run --shm-size={docker}m); a smaller --viewport takes less"
        )
    if isinstance(error, PermissionError) or error.errno == errno.EROFS:
        return f"{said}: /dev/shm has to be writable for the user who runs this"
    return said


def _bytes(number: int) -> str:
    return f"{number / MEBIBYTE:,.1f} MiB" if number >= MEBIBYTE else f"{number:,} bytes"


def scripts_not_written(folder: str, error: OSError) -> str:
    """Failures that cannot be written down."""
    return (
        f"the scripts of the failures cannot be written into {folder} ({_reason(error)}): "
        "--scripts names another folder"
    )


class Absent(NamedTuple):
    """What is known of a testee that the harness did not meet."""

    side: str
    """`client` or `server`."""
    where: str
    """Both channels with their addresses, and what became of each."""
    host: str
    patience: float
    argv: Sequence[str] = ()
    """The command that started it; none if somebody else was to start it."""
    ended: str = ""
    """How its process ended, if it did."""
    status: int | None = None
    printed: str = ""
    """The last of what it printed."""


def absent(it: Absent) -> str:
    """That no testee was met, and what to do."""
    verb = "nothing connected to" if it.side == "client" else "nothing listens on"
    when = f"the {it.side} {it.ended}" if it.ended else f"waited {it.patience:g} s"
    text = f"{verb} {it.where}: {when}"
    if it.printed.strip():
        text += f"; the last that it printed:\n{_indented(it.printed.strip())}"
    return "\n".join([text, *_what_to_try(it)])


def ended_by_itself(ended: str, printed: str) -> str:
    """That a testee which was met ended, where nothing else could be observed of it.

    Args:
        ended: who ended, and how.
        printed: the last that it printed.
    """
    text = f"Nothing was observed, since {ended} by itself, after it had been met"
    if printed.strip():
        return f"{text}; the last that it printed:\n{_indented(printed.strip())}"
    return f"{text}, and printed nothing."


def _indented(text: str) -> str:
    return "\n".join(f"  {line}" for line in text.splitlines())


def _what_to_try(it: Absent) -> list[str]:
    if not it.argv:
        return _unstarted(it)
    found = []
    if it.status == 0:
        found.append(
            "It ended as if all were well. If it only starts the real program and leaves, name the "
            "real program, or have it wait."
        )
    elif it.status == NO_SUCH_PROGRAM:
        found.append("With 127 a shell says that it did not find a command.")
    elif it.status == NO_PROGRAM:
        found.append("With 126 a shell says that a file is not executable.")
    if shell := _takes_a_shell(it.argv):
        found.append(f"In the command, {shell}.")
    found.append(
        f"The {it.side} is told where in SPLATBUS_HOST, SPLATBUS_IPC_PORT and SPLATBUS_MSG_PORT. "
        "One that does not read them has ports of its own: name those with --ports 6001,6000 "
        "(IPC first)."
    )
    if not it.ended:
        found.append("If it takes longer to start: --patience 60.")
    return found


def _unstarted(it: Absent) -> list[str]:
    found = [
        f"Was the {it.side} started, and does it use this host and these two ports (IPC first)? "
        "--ports names others; --patience waits longer."
    ]
    if it.host in ("127.0.0.1", "localhost", "::1"):
        elsewhere = "--host 0.0.0.0" if it.side == "client" else "--host with its address"
        found.append(
            f"{it.host} is this machine alone: if the {it.side} runs in a container, in WSL or on "
            f"another machine, use {elsewhere}, and let the firewall pass both ports."
        )
    else:
        found.append("A firewall between the two has to pass both ports.")
    return found
