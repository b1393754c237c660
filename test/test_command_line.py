# SPDX-License-Identifier: Apache-2.0
"""How executables end: one line and an exit code, whatever is wrong with what they are given and where they write."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import billiards_sim
from billiards_sim.command_line import (
    LONGEST_LINE,
    STOPPING,
    Failure,
    Parser,
    Refusal,
    Stopped,
    interrupt_on_signals,
    one_line,
    run_to_end,
    say,
)


def ended(*arguments: str | bytes, **options: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "billiards_sim", *arguments]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    return subprocess.run(command, text=True, timeout=120, check=False, **streams)  # type: ignore[call-overload, no-any-return]


def told(done: subprocess.CompletedProcess[str]) -> str:
    """What a process said on stderr, but for the compiling of a first run."""
    return "".join(line for line in done.stderr.splitlines(keepends=True) if "compiling the engine" not in line)


@pytest.mark.parametrize(
    ("reason", "code", "line"),
    [
        (Refusal("no\nsuch  thing"), 2, "play: no such thing\n"),
        (Failure("lost"), 1, "play: lost\n"),
        (Stopped(), 1, "play: stopped\n"),
        (KeyboardInterrupt(), 1, "play: stopped\n"),
    ],
)
def test_an_ending_is_one_line_and_its_code(
    reason: BaseException, code: int, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    def play() -> int:
        raise reason

    assert run_to_end("play", play) == code
    assert capsys.readouterr() == ("", line)


def test_a_code_is_handed_on_and_a_defect_is_not_hidden() -> None:
    assert run_to_end("play", lambda: 7) == 7
    with pytest.raises(ZeroDivisionError):
        run_to_end("play", lambda: 1 // 0)


def test_a_line_is_one_line_of_bounded_length_that_can_be_printed() -> None:
    assert one_line("a\r\n b\x1b[31m \ud800 ä\u00a0\U0001f3b1") == "a b\\x1b[31m \\ud800 ä \U0001f3b1"
    long = one_line("a" + 10**6 * "x" + "b")
    assert len(long) == LONGEST_LINE + len(" ... ")
    assert long[0] + long[-1] == "ab"


def test_a_parser_repeats_no_line_ends(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        Parser(prog="play").parse_args(["a\nb"])
    assert end.value.code == 2
    assert capsys.readouterr().err == "play: unrecognized arguments: a b (see play --help)\n"


def test_the_first_signal_interrupts_and_the_next_do_not() -> None:
    before = {number: signal.getsignal(number) for number in STOPPING}
    try:
        for number in STOPPING:
            signal.signal(number, signal.SIG_DFL)
        interrupt_on_signals()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGTERM)
        for number in STOPPING:
            os.kill(os.getpid(), number)
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        interrupt_on_signals()
        os.kill(os.getpid(), signal.SIGHUP)  # as under nohup
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_a_signal_within_exec_leaves_the_exit_code(tmp_path: Path) -> None:
    (tmp_path / "play.py").write_text(f"""
import sys
from billiards_sim.command_line import interrupt_on_signals, run_to_end
interrupt_on_signals()
sys.exit(run_to_end("play", lambda: exec("import os; os.kill(os.getpid(), {int(signal.SIGTERM)})")))
""")
    path = os.pathsep.join((str(tmp_path), str(Path(billiards_sim.__file__).parents[1])))
    command = [sys.executable, "-m", "play"]
    done = subprocess.run(
        command, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (1, "", "play: stopped\n")


def test_say_prints_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    say("one")
    say("two", end="")
    assert capsys.readouterr().out == "one\ntwo"


@pytest.mark.parametrize(
    "arguments", [("simulate", "head_on"), ("simulate", "--help"), ("benchmark", "--help"), ("-h",)]
)
def test_a_full_device_for_an_output_is_one_line_and_code_1(arguments: tuple[str, ...]) -> None:
    with open("/dev/full", "wb") as device:
        done = ended(*arguments, stdout=device)
    assert done.returncode == 1
    name = arguments[0] if len(arguments) > 1 else "billiards_sim"
    assert told(done) == f"{name}: cannot write to stdout: No space left on device\n"


@pytest.mark.parametrize("arguments", [("simulate", "head_on"), ("simulate", "--help"), ("-h",)])
def test_an_output_that_nobody_reads_ends_it_quietly(arguments: tuple[str, ...]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        done = ended(*arguments, stdout=writer)
    finally:
        os.close(writer)
    assert (done.returncode, told(done)) == (1, "")


def test_names_that_a_terminal_cannot_show_are_written_as_python_does(tmp_path: Path) -> None:
    path = tmp_path / "ä.json"
    done = ended("simulate", "head_on", "--json", str(path), env={**os.environ, "PYTHONIOENCODING": "ascii"})
    assert done.returncode == 0, done.stderr
    assert "\\xe4.json" in done.stdout
    assert path.is_file()


@pytest.mark.parametrize("arguments", [("simulate", b"\xff"), ("simulate", "head_on", "--json", b"/tmp/\xff")])
def test_an_argument_that_is_not_utf_8_is_one_line_and_code_2(arguments: tuple[str | bytes, ...]) -> None:
    done = ended(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("simulate: arguments must be UTF-8, got b'")
    assert done.stderr.count("\n") == 1


def test_nothing_that_takes_time_is_imported_before_signals_are_taken_care_of() -> None:
    slow = {"numpy", "numba", "argparse"}
    code = f"import sys, billiards_sim.__main__; print(sorted({slow} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize("number", STOPPING)
def test_a_signal_during_the_imports_ends_it_quietly(tmp_path: Path, number: int) -> None:
    (tmp_path / "numpy.py").write_text(f"import os\nos.kill(os.getpid(), {int(number)})\n")
    done = ended("simulate", "head_on", env={**os.environ, "PYTHONPATH": str(tmp_path)})
    assert (done.returncode, done.stdout, done.stderr) == (1, "", "simulate: stopped\n")


def test_every_public_name_is_there_and_no_other() -> None:
    for name in billiards_sim.__all__:
        assert getattr(billiards_sim, name).__name__.rpartition(".")[2] == name
        assert name in dir(billiards_sim)
    with pytest.raises(AttributeError, match="module 'billiards_sim' has no attribute 'Pool'"):
        billiards_sim.Pool  # noqa: B018
