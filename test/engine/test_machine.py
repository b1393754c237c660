# SPDX-License-Identifier: Apache-2.0
"""Machine code comes by itself, nobody waits for it, and what is kept of it is safe to use.

Most tests run a copy of the package in which a stand-in for the compiler hands out, as slowly as asked for, the code of
the real one.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from checks import COMPILED

import billiards_sim as bs
from billiards_sim.engine import machine, object_file

KEPT = object_file.find(object_file.file_name())[0] if COMPILED else None

pytestmark = pytest.mark.skipif(KEPT is None, reason="needs Numba, switched on, and a cache directory")

TIMEOUT = 60.0
"""s, after which something hangs; all of it takes a second or two."""

FOR_EVER = 3600.0
"""s that a stand-in takes which is to be ended."""

STAND_IN = """
import os, time
from pathlib import Path

def object_code():
    log = os.open({log!r}, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.write(log, b"%d %d\\n" % (os.getpid(), os.nice(0)))
    time.sleep(float(Path({seconds!r}).read_text()))
    {end}

def dispatchers():
    {own_way}
"""

PLAY = """
import sys, threading, time
import billiards_sim as bs
from billiards_sim.engine import machine
machine.PATIENCE = 3600.0  # nothing is said of a wait, however slow the machine is
def play():
    return len(bs.Simulation(bs.scenes.head_on()).run())
"""


class Site:
    """A copy of the package, to be run and to be changed, with a cache of its own.

    Attributes:
        cache: the folder that NUMBA_CACHE_DIR names.
        environment: of its processes.
    """

    def __init__(self, path: Path) -> None:
        self.engine = path / "site/billiards_sim/engine"
        self.cache = path / "cache"
        self._log, self._seconds = path / "log", path / "seconds"
        shutil.copytree(
            Path(bs.__file__).parent, self.engine.parent, ignore=shutil.ignore_patterns("__pycache__", "ros", "study")
        )
        self.environment = {**os.environ, "NUMBA_CACHE_DIR": str(self.cache), "PYTHONDONTWRITEBYTECODE": "1"}
        self._children: list[subprocess.Popen[str]] = []
        code = path / "code"
        code.write_bytes(KEPT or b"")
        self.stand_in(f"return Path({str(code)!r}).read_bytes()")
        self.takes(0.0)

    def stand_in(self, end: str, own_way: str = "raise NotImplementedError") -> None:
        """What becomes of compiling."""
        text = STAND_IN.format(log=str(self._log), seconds=str(self._seconds), end=end, own_way=own_way)
        (self.engine / "compiler.py").write_text(text, encoding="utf-8")

    def takes(self, seconds: float) -> None:
        """How long compiling takes, s."""
        self._seconds.write_text(str(seconds), encoding="utf-8")

    def start(self, code: str) -> subprocess.Popen[str]:
        # In a group of its own, as a shell starts it.
        text = f"import sys; sys.path.insert(0, {str(self.engine.parent.parent)!r})\n{PLAY}\n{code}"
        pipe = subprocess.PIPE
        self._children.append(
            subprocess.Popen(
                [sys.executable, "-c", text],
                stdin=pipe,
                stdout=pipe,
                stderr=pipe,
                text=True,
                env=self.environment,
                start_new_session=True,
            )
        )
        return self._children[-1]

    def run(self, code: str) -> tuple[str, str]:
        """What a process that must end well writes on stdout and stderr."""
        process = self.start(code)
        output, errors = process.communicate(timeout=TIMEOUT)
        assert process.returncode == 0, errors
        return output.strip(), errors

    def compilers(self) -> list[tuple[int, int]]:
        """Process id and niceness of those that have begun to compile."""
        if not self._log.exists():
            return []
        lines = self._log.read_text(encoding="utf-8").splitlines()
        return [(int(line.split()[0]), int(line.split()[1])) for line in lines]

    def end(self) -> None:
        for process in self._children:
            if process.poll() is None:
                process.kill()
            process.communicate()


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    made = Site(tmp_path)
    yield made
    made.end()
    wait_until(lambda: not any(map(is_alive, made.compilers())))


def wait_until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def is_alive(compiler: tuple[int, int]) -> bool:
    try:
        status = Path(f"/proc/{compiler[0]}/stat").read_text(encoding="utf-8")
    except OSError:
        return False
    return status.rpartition(")")[2].split()[0] != "Z"  # nobody may have asked how it ended


def test_nothing_starts_before_something_plays(site: Site) -> None:
    made = "bs.Simulation(bs.scenes.rack()).copy()"
    look = "print(len(sys._current_frames()), [name for name in ('numba', 'llvmlite') if name in sys.modules])"
    assert site.run(f"{made}\n{look}") == ("1 []", "")


def test_who_plays_does_not_wait_for_the_compiler(site: Site) -> None:
    site.takes(FOR_EVER)
    assert site.run("print(play(), machine.is_ready())") == ("10 False", "")


def test_a_simulation_changes_over_while_it_runs(site: Site) -> None:
    site.takes(0.3)
    code = """
sim = bs.Simulation(bs.scenes.rack(physics=bs.Physics(sliding_friction=0.0, rail_restitution=1.0)))
sim.strike((128.0, 1.5, 0.0))
from billiards_sim.engine.tables import Packed
while not isinstance(sim._now.state, Packed):
    sim.advance(0.1)
print("changed over")
"""
    assert site.run(code) == ("changed over", "")


def test_the_compiler_has_low_priority(site: Site) -> None:
    site.run("bs.compile()")
    ((_, niceness),) = site.compilers()
    assert niceness == os.nice(0) + object_file.NICENESS


def test_waiting_is_announced_once_if_it_takes_long(site: Site) -> None:
    site.takes(0.5)
    code = "machine.PATIENCE = 0.1; print(bs.compile(), bs.compile(), play())"
    output, errors = site.run(code)
    assert output == "True True 10"
    assert errors == "billiards_sim: compiling the engine, about 20 s; it is kept for the next time\n"
    assert site.run(code.replace("0.1", "30.0")) == ("True True 10", "")
    assert len(site.compilers()) == 1


def test_what_is_kept_is_there_for_the_first_call(site: Site) -> None:
    site.run("bs.compile()")
    assert site.run("machine.LOOK = 30.0; print(play(), machine.is_ready())") == ("10 True", "")


@pytest.mark.parametrize("changed", ["kernels/state.py", "tables.py", "compiler.py"])
@pytest.mark.parametrize("given", [True, False], ids=["NUMBA_CACHE_DIR", "beside the sources"])
def test_machine_code_of_former_sources_is_not_used(site: Site, given: bool, changed: str) -> None:
    cache = site.cache if given else site.engine / "__pycache__"
    site.environment["NUMBA_CACHE_DIR"] = str(cache) if given else ""
    for _ in range(2):
        assert site.run("print(bs.compile())") == ("True", "")
    assert len(site.compilers()) == 1
    path = site.engine / changed
    before = path.stat()
    text = path.read_text(encoding="utf-8")
    path.write_text(f"{text}#\n", encoding="utf-8")
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))  # the content decides
    assert site.run("print(bs.compile())") == ("True", "")
    assert len(site.compilers()) == 2
    assert len(list(cache.glob("billiards_sim-*.o"))) == 1


@pytest.mark.parametrize("bad", ["half", "foreign", "empty", "of another name", "others could write it"])
def test_a_bad_file_is_replaced(site: Site, bad: str) -> None:
    site.run("bs.compile()")
    (kept,) = site.cache.glob("*.o")
    good = kept.read_bytes()
    if bad == "others could write it":
        kept.chmod(0o666)
    elif bad == "of another name":
        kept.write_bytes(object_file.sealed("another.o", object_file.unsealed(kept.name, good) or b""))
    else:
        kept.write_bytes({"half": good[: len(good) // 2], "foreign": b"\x7fELF" * 9999, "empty": b""}[bad])
    assert site.run("print(bs.compile(), play())") == ("True 10", "")
    assert len(site.compilers()) == 2
    (kept,) = site.cache.glob("*.o")
    assert kept.read_bytes() == good
    assert kept.stat().st_mode & 0o022 == 0


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs root, to give a file away")
def test_a_file_of_another_user_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "installed-sources.o"
    object_file.write(path, b"code")
    assert object_file.read(path) == b"code"
    os.chown(path, 12345, -1)
    assert object_file.read(path) is None


def test_what_a_killed_process_left_goes_with_the_next_write(tmp_path: Path) -> None:
    (tmp_path / "installed-sources.4711").touch()
    (tmp_path / "installed-former.o").touch()
    (tmp_path / "another-sources.o").touch()
    object_file.write(tmp_path / "installed-sources.o", b"code")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["another-sources.o", "installed-sources.o"]


def test_a_file_appears_under_its_name_when_it_is_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "installed-sources.o"
    before: list[tuple[bool, bytes]] = []
    replace = Path.replace

    def observed(beside: Path, target: Path) -> Path:
        before.append((path.exists(), beside.read_bytes()))
        return replace(beside, target)

    monkeypatch.setattr(Path, "replace", observed)
    object_file.write(path, b"code")
    assert before == [(False, path.read_bytes())]


def test_without_a_directory_to_write_in_the_engine_is_compiled_and_not_kept(site: Site, tmp_path: Path) -> None:
    nowhere = tmp_path / "file"
    nowhere.touch()
    (site.engine / "__pycache__").touch()
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    folders = {"NUMBA_CACHE_DIR": nowhere / "numba", "XDG_CACHE_HOME": nowhere / "cache", "TMPDIR": temporary}
    site.environment.update({name: str(path) for name, path in folders.items()})
    for count in (1, 2):
        output, errors = site.run("print(bs.compile(), play())")
        assert output == "True 10"
        assert errors.count("\n") == 1
        assert "cannot be kept, no cache directory can be written" in errors
        assert len(site.compilers()) == count
        assert not list(temporary.iterdir())


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM, None], ids=["killed", "terminated", "ended"])
def test_the_compiler_ends_with_who_started_it(site: Site, end: int | None) -> None:
    site.takes(FOR_EVER)
    process = site.start("play(); sys.stdin.read()")
    wait_until(site.compilers)
    (compiler,) = site.compilers()
    assert is_alive(compiler)
    if end is None:
        process.communicate(timeout=TIMEOUT)
    else:
        process.send_signal(end)
    wait_until(lambda: not is_alive(compiler))
    assert not list(site.cache.glob("*.o"))


def test_the_compiler_does_not_live_on_with_a_forked_process(site: Site) -> None:
    site.takes(FOR_EVER)
    code = """
import os
play()
machine._search.looked.wait()
forked = os.fork()
if forked == 0:
    time.sleep(3600.0)
print(forked, flush=True)
sys.stdin.read()
os._exit(0)
"""
    process = site.start(code)
    assert process.stdout is not None and process.stdin is not None
    forked = int(process.stdout.readline())
    try:
        wait_until(site.compilers)
        (compiler,) = site.compilers()
        process.kill()
        wait_until(lambda: not is_alive(compiler))
        assert is_alive((forked, 0))
    finally:
        os.kill(forked, signal.SIGKILL)


def test_processes_of_a_pool_share_one_compiler(site: Site) -> None:
    site.takes(0.5)
    code = """
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
def work(_):
    return play(), bs.compile()
if __name__ == "__main__":
    play()
    with ProcessPoolExecutor(3, multiprocessing.get_context("fork")) as pool:
        print(*pool.map(work, range(6)))
"""
    assert site.run(code) == (" ".join(["(10, True)"] * 6), "")
    assert len(site.compilers()) == 1


def test_of_two_processes_one_compiles(site: Site) -> None:
    site.takes(0.5)
    both = [site.start("print(bs.compile(), play())") for _ in range(2)]
    assert [process.communicate(timeout=TIMEOUT)[0].strip() for process in both] == ["True 10", "True 10"]
    assert len(site.compilers()) == 1


def test_threads_that_play_at_once_start_one_compiler(site: Site) -> None:
    site.takes(0.2)
    code = """
machine.object_file.find = lambda name, find=machine.object_file.find: looks.append(name) or find(name)
looks = []
threads = [threading.Thread(target=play) for _ in range(8)]
for thread in threads: thread.start()
for thread in threads: thread.join()
print(bs.compile(), len(looks))
"""
    assert site.run(code) == ("True 1", "")
    assert len(site.compilers()) == 1


def test_ctrl_c_ends_the_waiting_alone(site: Site) -> None:
    site.takes(FOR_EVER)
    code = """
try:
    print("waiting", flush=True)
    bs.compile()
except KeyboardInterrupt:
    print("heard", play(), flush=True)
    sys.stdin.read()
"""
    process = site.start(code)
    assert process.stdout is not None
    wait_until(site.compilers)
    os.killpg(process.pid, signal.SIGINT)
    assert [process.stdout.readline() for _ in range(2)] == ["waiting\n", "heard 10\n"]
    ((compiler, _),) = site.compilers()
    assert os.getpgid(compiler) != process.pid


def test_a_compiler_that_fails_is_tried_once_and_quietly(site: Site) -> None:
    site.stand_in("raise MemoryError('too little')")
    code = "play(); machine._search.ended.wait(); print(play(), play(), machine.is_ready())"
    assert site.run(code) == ("10 10 False", "")
    assert len(site.compilers()) == 1


def test_compile_tells_why_there_is_no_machine_code(site: Site) -> None:
    site.stand_in("raise MemoryError('too little')")
    output, errors = site.run("print(bs.compile(), play())")
    assert output == "False 10"
    first, second = errors.splitlines()
    assert first.startswith("billiards_sim: compiling the engine in this process")
    assert "MemoryError: too little" in first
    assert second == "billiards_sim: the engine stays interpreted: NotImplementedError: "


@pytest.mark.parametrize("end", ["os.kill(os.getpid(), 9)", "return b''"])
def test_without_object_code_the_engine_is_compiled_as_numba_does_it(site: Site, end: str) -> None:
    called = "return {'run_until': lambda *addresses: print('called with', len(addresses)) or 0}"
    site.stand_in(end, own_way=called)
    output, errors = site.run("print(bs.compile()); bs.Simulation(bs.scenes.head_on()).run()")
    assert output.splitlines() == ["True", "called with 4"]
    assert errors.count("\n") == 1


def test_a_handler_of_signals_is_heard_through_the_change_over(site: Site) -> None:
    # Its exception is no failure of what it interrupts, whatever its kind.
    site.run("bs.compile()")
    code = """
import signal
def ring(*_): raise TimeoutError
signal.signal(signal.SIGALRM, ring)
heard = 0
play()
for attempt in range(400):
    machine._functions.clear(); machine._search, machine._sought = None, False
    signal.setitimer(signal.ITIMER_REAL, 5e-5 * 1.019**attempt)  # up to 0.1 s
    try:
        play(); time.sleep(1.0)
    except TimeoutError:
        heard += 1
print(heard, bs.compile())
"""
    assert site.run(code) == ("400 True", "")


def test_a_thread_is_started_whole_whatever_a_handler_of_signals_raises(site: Site) -> None:
    code = """
import signal
def ring(*_): raise TimeoutError
signal.signal(signal.SIGALRM, ring)
for attempt in range(2000):
    try:
        signal.setitimer(signal.ITIMER_REAL, 1e-6 * (1 + attempt % 100))
        machine._begin(lambda: None)
        while True: time.sleep(0.0005)
    except TimeoutError:
        pass
"""
    assert site.run(code) == ("", "")


@pytest.mark.parametrize("variable, value", [("BILLIARDS_SIM_COMPILE", "0"), ("NUMBA_DISABLE_JIT", "1")])
def test_the_engine_is_interpreted_where_that_is_wanted(site: Site, variable: str, value: str) -> None:
    site.environment[variable] = value
    code = "print(play(), bs.compile(), len(sys._current_frames()), 'llvmlite' in sys.modules)"
    assert site.run(code) == ("10 False 1 False", "")


@pytest.mark.parametrize("value", ["", "1"])
def test_the_switch_says_yes_by_default(site: Site, value: str) -> None:
    site.environment.update(BILLIARDS_SIM_COMPILE=value, NUMBA_DISABLE_JIT="0")
    assert site.run("print(bs.compile())") == ("True", "")


@pytest.mark.parametrize("call", [bs.compile, machine.seek])
def test_a_switch_without_meaning_is_refused(call: Callable[[], object], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "_sought", False)
    monkeypatch.setenv("BILLIARDS_SIM_COMPILE", "off")
    with pytest.raises(ValueError, match=re.escape("must be 0 (interpreted) or 1 (compiled), got 'off'")):
        call()
