# SPDX-License-Identifier: Apache-2.0
"""The documents: links lead somewhere, and what they print runs. Command lines for ROS are in `ros/`."""

from __future__ import annotations

import math
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from documents import DOCUMENTS, REPOSITORY, blocks, command_lines, complete

import billiards_sim as bs
from billiards_sim.engine.scene_file import load_scene

README = REPOSITORY / "README.md"

RUN = (
    "ros2 run billiards_sim plan",
    "ros2 run billiards_sim shoot",
    "ros2 run billiards_sim simulate",
    "ros2 run billiards_sim table",
    "ros2 param set",
    "ros2 service call",
    "ros2 topic pub",
    "python3 -m billiards_sim plan",
    "python3 -m billiards_sim simulate",
    "python3 docs/learn.py",
    "python3 docs/pots.py",
    "python3 -m billiards_sim table",
    "shoot",
)
"""Command lines that a test runs, those of ROS 2 with the same topic, type and message or with the same arguments."""

HELD_TO_THE_CODE = (
    "make",
    "pip install",
    "pytest",
    ".venv/bin/python -m pytest",
    "ros2 bag record",
    "ros2 topic echo",
    "ros2 launch billiards_sim",
    "rviz2 -d",
)
"""Command lines whose names of files, extras, targets and topics a test looks up."""

BY_HAND = (
    ".venv/bin/pip install numba",
    ".venv/bin/python -m colcon build",
    ".venv/bin/python -m ruff format",
    "cd",
    "colcon build",
    "colcon test",
    "mkdir",
    "python -m billiards_sim.ros.tools.node_load",
    "python test/measure_play.py",
    "python test/picture_play.py",
    "python3 -m billiards_sim benchmark",
    "python3 -m billiards_sim play",
    "python3 -m billiards_sim.ros.tools.picture",
    "python3 -m venv",
    "ros2 param load",
    "ros2 run billiards_sim play",
    "rosdep install",
    "rosdoc2 build",
    "source",
    "sudo apt install",
    "touch",
)
"""Command lines that take long, change the machine or belong to others; `CONTRIBUTING.md` says so."""


def title(words: tuple[str, ...]) -> str:
    return " ".join(words)


def test_every_command_line_is_run_or_looked_up_or_left_to_hands() -> None:
    known = (*RUN, *HELD_TO_THE_CODE, *BY_HAND)
    lines = [title(words) for words in complete(command_lines())]
    assert [line for line in lines if not f"{line} ".startswith(tuple(f"{start} " for start in known))] == []
    assert [start for start in known if not any(f"{line} ".startswith(f"{start} ") for line in lines)] == []


def test_targets_of_make_are_in_the_makefile() -> None:
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    targets = {target for _, target in command_lines("make")}
    assert {"demo", "test"} <= targets
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_extras_are_in_the_setup(monkeypatch: pytest.MonkeyPatch) -> None:
    declared: dict[str, object] = {}
    monkeypatch.setattr("setuptools.setup", declared.update)
    monkeypatch.chdir(REPOSITORY)
    runpy.run_path("setup.py")
    asked = {name for line in command_lines("pip", "install") for name in re.findall(r"\.\[(.*)\]", line[-1])}
    assert "ros,fast" in asked
    assert {extra for extras in asked for extra in extras.split(",")} <= set(declared["extras_require"])


@pytest.mark.parametrize(
    "words", command_lines("pytest") + command_lines(".venv/bin/python", "-m", "pytest"), ids=title
)
def test_tests_that_are_named_exist(words: tuple[str, ...]) -> None:
    assert (REPOSITORY / words[-1]).exists()


def simulations() -> list[tuple[str, ...]]:
    return [words[4:] for words in complete(command_lines("python3", "-m", "billiards_sim", "simulate"))]


@pytest.mark.parametrize("arguments", simulations(), ids=title)
def test_simulate_does_what_is_printed(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    for module in ("matplotlib", "PIL", "tqdm", "imageio_ffmpeg", "yaml", "rclpy", "mcap"):
        pytest.importorskip(module)
    (scene,) = blocks(REPOSITORY / "docs" / "engine.md", "yaml")
    (tmp_path / "my_scene.yaml").write_text(scene, encoding="utf-8")
    (tmp_path / "docs").mkdir()
    done = run("-m", "billiards_sim", "simulate", *arguments, directory=tmp_path)
    assert done.returncode == 0, done.stderr
    for option, value in zip(arguments, arguments[1:]):
        if option in ("--plot", "--movie", "--json", "--csv"):
            assert (tmp_path / value).stat().st_size > 100
        if option == "--bag":
            assert (tmp_path / value / "metadata.yaml").stat().st_size > 100


PLAN = complete(command_lines("python3", "-m", "billiards_sim", "plan"))


@pytest.mark.parametrize("words", PLAN, ids=title)
def test_plan_does_what_is_printed(tmp_path: Path, words: tuple[str, ...]) -> None:
    for module in ("matplotlib", "yaml"):
        pytest.importorskip(module)
    document = REPOSITORY / "docs" / "rollouts.md"
    (scene,) = blocks(document, "yaml")
    (tmp_path / "end_game.yaml").write_text(scene, encoding="utf-8")
    done = run("-m", "billiards_sim", *words[3:], directory=tmp_path)
    assert done.returncode == 0, done.stderr
    (shown,) = blocks(document, "text")
    assert done.stdout.splitlines()[1:3] == shown.splitlines()[:2] or "--ball" not in words
    for option, value in zip(words, words[1:]):
        if option in ("--plot", "--yaml"):
            assert (tmp_path / value).stat().st_size > 100


def test_the_plan_that_is_shown_is_worth_what_it_says(tmp_path: Path) -> None:
    pytest.importorskip("yaml")
    document = REPOSITORY / "docs" / "rollouts.md"
    (scene,) = blocks(document, "yaml")
    (tmp_path / "end_game.yaml").write_text(scene, encoding="utf-8")
    where = load_scene(tmp_path / "end_game.yaml")
    (shown,) = blocks(document, "text")
    rows = [line.split() for line in shown.splitlines()[2:]]
    assert len(rows) > 1
    for _, ball, _, _, speed, azimuth, side, up, _, success, _, error, *_ in rows:
        shot = bs.Shots([float(speed)], math.radians(float(azimuth)), float(side), float(up))
        noisy = bs.rollout(where, shot, noise=bs.ShooterNoise.tournament(), samples=400, seed=11)
        falls = 100.0 * bs.goals.pocket(where, ball)(noisy).mean()
        assert falls == pytest.approx(float(success), abs=4.0 * math.sqrt(2.0) * float(error))


@pytest.mark.parametrize("document", [README, REPOSITORY / "docs" / "engine.md"], ids=lambda path: path.name)
def test_the_python_of_a_document_runs_from_top_to_bottom(document: Path, tmp_path: Path) -> None:
    code = [block for block in blocks(document, "python") if "rclpy" not in block]
    assert code
    done = run("-c", "\n".join(code), directory=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "ball_ball" in done.stdout


def test_the_rollouts_that_are_shown_run(tmp_path: Path) -> None:
    code = [block for block in blocks(REPOSITORY / "docs" / "rollouts.md", "python") if "rollout(" in block]
    script = tmp_path / "cluster.py"
    script.write_text(next(block for block in code if "Cluster" in block), encoding="utf-8")
    local = [block for block in code if "Cluster" not in block and "gymnasium" not in block]
    done = run("-c", "\n".join(local), directory=tmp_path)
    assert done.returncode == 0, done.stderr
    pytest.importorskip("distributed")
    pytest.importorskip("tqdm")
    done = run(str(script), directory=tmp_path)
    assert done.returncode == 0, done.stderr
    assert 0.0 <= float(done.stdout.rpartition(":")[2]) < 1.0
    assert "2000/2000" in done.stderr


def run(*arguments: str, directory: Path) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join(filter(None, (str(REPOSITORY), os.environ.get("PYTHONPATH"))))
    return subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONPATH": path},
        cwd=directory,
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )


def headings(document: Path) -> set[str]:
    """Of a document, as links name them: lower case, hyphens for blanks, no other punctuation."""
    lines = re.findall(r"^#+ (.*)$", document.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", line.lower()).replace(" ", "-") for line in lines}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(REPOSITORY)))
def test_links_lead_somewhere(document: Path) -> None:
    for link in re.findall(r"\]\(([^)\s]+)\)", document.read_text(encoding="utf-8")):
        target, _, heading = link.partition("#")
        found = (document.parent / target).resolve() if target else document
        assert "://" in link or found.exists(), link
        assert not heading or heading in headings(found), link


def test_every_document_is_reached_from_the_readme() -> None:
    reached, waiting = set(), [README]
    while waiting:
        document = waiting.pop()
        reached.add(document)
        links = re.findall(r"\]\(([^)#\s]+\.md)", document.read_text(encoding="utf-8"))
        waiting += {(document.parent / link).resolve() for link in links} - reached
    assert reached == set(DOCUMENTS)


def test_every_module_is_in_the_design() -> None:
    design = (REPOSITORY / "docs" / "design.md").read_text(encoding="utf-8")
    modules = {path.stem for path in (REPOSITORY / "billiards_sim").rglob("*.py") if not path.stem.startswith("__")}
    assert {module for module in modules if f"`{module}`" not in design} == set()


def test_every_block_of_code_says_its_language() -> None:
    for document in DOCUMENTS:
        fences = re.findall(r"^```.*$", document.read_text(encoding="utf-8"), re.MULTILINE)
        assert set(fences[::2]) <= {"```sh", "```python", "```yaml", "```text"}, document
        assert set(fences[1::2]) <= {"```"}, document


def test_documentation_tools_find_the_documents() -> None:
    assert (REPOSITORY / "doc").resolve() == REPOSITORY / "docs"  # where rosdoc2 looks


def test_the_readme_is_short() -> None:
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 180
