# SPDX-License-Identifier: Apache-2.0
"""The file that keeps the machine code of the kernels: its name, where it lies, and the process that writes it.

The name says what the code is made of, and for which processor: other sources, another file. What is in it is executed,
so a file is used only if nobody but this user, or root, can have written it, and only if it is whole.
"""

from __future__ import annotations

import hashlib
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile

try:
    import fcntl
except ImportError:  # not POSIX: two processes may then do the same work
    fcntl = None  # type: ignore[assignment]

HERE = Path(__file__).parent

NICENESS = 5
"""Of the process that compiles. At 19 it takes twice as long beside a busy one."""

COMMAND = "import sys; sys.path[:] = sys.argv[2:]; from billiards_sim.engine import object_file; object_file.make()"


def file_name() -> str:
    """Of what these sources are on this machine."""
    return f"{_installed()}-{_digest(*_sources())}.o"


def _installed() -> str:
    # What stays when the sources change.
    from importlib.metadata import version  # takes 20 ms, and is needed here alone

    import llvmlite
    import llvmlite.binding as llvm

    tools = (sys.version, *map(version, ("numpy", "numba")), llvmlite.__version__)
    processor = (llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten())
    wanted = (os.environ.get(name, "") for name in ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"))
    return f"billiards_sim-{_digest(str(HERE), *tools, *processor, *wanted)}"


def _sources() -> Iterator[str | bytes]:
    for path in (*sorted((HERE / "kernels").rglob("*.py")), HERE / "tables.py", HERE / "compiler.py"):
        yield str(path.relative_to(HERE))
        yield path.read_bytes()


def _digest(*parts: str | bytes) -> str:
    digest = hashlib.sha256()
    for part in parts:
        content = part.encode() if isinstance(part, str) else part
        digest.update(b"%d " % len(content) + content)
    return digest.hexdigest()[:16]


def find(name: str) -> tuple[bytes | None, Path | None]:
    """The code in the file of this name, if there is a good one, and the folder where it is or can be written.

    That is the first of several. Both None: nothing can be written anywhere.
    """
    for folder in _folders():
        code = read(folder / name)
        if code is not None or _is_writable(folder):
            return code, folder
    return None, None


def _folders() -> list[Path]:
    given = os.environ.get("NUMBA_CACHE_DIR")
    of_user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    found = [Path(given).absolute()] if given else []
    return [*found, HERE / "__pycache__", *([Path(of_user)] if os.path.isabs(of_user) else [])]


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def read(path: Path) -> bytes | None:
    """The code in a file; None if it is not there, not whole, of another name, or others could have written it."""
    with suppress(OSError), path.open("rb") as file:
        state = os.fstat(file.fileno())
        owners = (0, os.geteuid()) if hasattr(os, "geteuid") else (state.st_uid,)
        if state.st_uid in owners and not state.st_mode & 0o022:
            return unsealed(path.name, file.read())
    return None


def write(path: Path, code: bytes) -> None:
    """Put code into a file that appears under its name when it is whole. Those of former sources go."""
    beside = path.with_suffix(f".{os.getpid()}")
    with open(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644), "wb") as file:
        file.write(sealed(path.name, code))
    beside.replace(path)
    installed, _, _ = path.name.rpartition("-")
    for former in path.parent.glob(f"{installed}-*"):
        if former != path:
            former.unlink(missing_ok=True)


def sealed(name: str, code: bytes) -> bytes:
    """What a file of this name holds."""
    return hashlib.sha256(name.encode() + code).digest() + code


def unsealed(name: str, content: bytes) -> bytes | None:
    """The code in what a file of this name holds; None if that is not whole."""
    code = content[hashlib.sha256().digest_size :]
    return code if code and sealed(name, code) == content else None


class Maker:
    """A process that compiles the kernels, or waits for another one that does. It ends with this one.

    Args:
        name: of the file.
        folder: that it is written to; None: it is kept nowhere.

    Attributes:
        keeps: whether it is written to a folder.
    """

    def __init__(self, name: str, folder: Path | None) -> None:
        if not sys.executable or hasattr(sys, "frozen"):
            raise OSError("there is no Python to start")
        import subprocess  # takes 10 ms, and is seldom needed

        self.keeps = folder is not None
        self._name = name
        self._path = folder and folder / name
        self._output = None if folder else TemporaryFile()  # noqa: SIM115
        self._process = subprocess.Popen(
            [sys.executable, "-c", COMMAND, str(self._path or name), *sys.path],
            stdin=subprocess.PIPE,  # its end tells the other process that this one has ended
            stdout=self._output or subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is not for it
        )

    def code(self) -> bytes:
        """Wait for it.

        Raises:
            RuntimeError: it failed.
        """
        assert self._process.stderr is not None
        said = self._process.stderr.read().decode(errors="replace").strip().splitlines()
        status = self._process.wait()
        if self._path is not None:
            code = read(self._path)
        else:
            assert self._output is not None
            self._output.seek(0)
            code = unsealed(self._name, self._output.read())
        if status != 0 or code is None:
            raise RuntimeError(said[-1] if said else f"the compiling process ended with {status}")
        return code

    def disown(self) -> None:
        """After a fork: it belongs to the parent, with whom it is to end."""
        assert self._process.stdin is not None
        self._process.stdin.close()


def make() -> None:
    """What the other process does."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    path = Path(sys.argv[1])
    try:
        if path.is_absolute():
            _make_file(path)
        else:
            with open(1, "wb", closefd=False) as output:
                output.write(sealed(path.name, _compiled(path.name)))
    except Exception as error:
        sys.exit(f"{type(error).__name__}: {error}")


def _make_file(path: Path) -> None:
    with _alone(path):
        if read(path) is None:
            write(path, _compiled(path.name))


def _compiled(name: str) -> bytes:
    if name != file_name():
        raise RuntimeError("the sources have changed meanwhile")
    from billiards_sim.engine.compiler import object_code

    return object_code()


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    # One process of this machine at a time: those that wait find what the first has written.
    installed, _, _ = path.name.rpartition("-")
    with path.with_name(f"{installed}.lock").open("ab") as lock:
        if fcntl is not None:
            with suppress(OSError):  # a file system that has no locks
                fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _end_with_parent() -> None:
    os.read(0, 1)
    os._exit(1)
