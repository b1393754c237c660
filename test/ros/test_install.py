# SPDX-License-Identifier: Apache-2.0
"""colcon builds the package in a clean workspace, and the node starts from the installed prefix."""

import asyncio
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import tornado.websocket
from conftest import Site

REPOSITORY = Path(__file__).parents[2]
SOURCES = (
    "package.xml",
    "setup.py",
    "setup.cfg",
    "pyproject.toml",
    "resource",
    "config",
    "launch",
    "billiards_sim",
    "LICENSE",
)
BUILD_TIMEOUT = 120.0


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The installed prefix of the package."""
    workspace = tmp_path_factory.mktemp("workspace")
    package = workspace / "src" / "billiards_sim"
    package.mkdir(parents=True)
    for name in SOURCES:
        source = REPOSITORY / name
        if source.is_dir():
            shutil.copytree(source, package / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, package / name)
    environment = {**os.environ, "COLCON_LOG_PATH": str(workspace / "log"), "COLCON_DEFAULTS_FILE": os.devnull}
    build = subprocess.run(
        [str(Path(sys.executable).parent / "colcon"), "build", "--event-handlers", "console_direct+"],
        cwd=workspace,
        env=environment,
        capture_output=True,
        text=True,
        timeout=BUILD_TIMEOUT,
        check=False,
    )
    assert build.returncode == 0, build.stdout + build.stderr
    return workspace / "install" / "billiards_sim"


def menu(address: str) -> Any:
    """What a page of `play` is told first."""

    async def ask() -> Any:
        page = await tornado.websocket.websocket_connect(address.replace("http", "ws") + "socket")
        return json.loads(await page.read_message())

    return asyncio.run(asyncio.wait_for(ask(), 60.0))


def test_share_holds_the_configuration_and_the_marker(prefix: Path) -> None:
    share = prefix / "share"
    assert (share / "ament_index/resource_index/packages/billiards_sim").is_file()
    # colcon makes this one for ament packages only, not for what it takes for a plain Python package.
    assert (share / "billiards_sim/hook/ament_prefix_path.sh").is_file()
    for name in ("package.xml", "config/table.yaml", "config/table.rviz", "launch/table.launch.py"):
        installed = share / "billiards_sim" / name
        assert installed.read_text() == (REPOSITORY / name).read_text()


def test_the_exact_solutions_are_installed(prefix: Path) -> None:
    assert len(list(prefix.glob("lib/python*/site-packages/billiards_sim/study/truth.json"))) == 1


def test_the_page_is_installed(prefix: Path) -> None:
    (page,) = prefix.glob("lib/python*/site-packages/billiards_sim/play/page")
    names = {path.name for path in (REPOSITORY / "billiards_sim" / "play" / "page").iterdir()}
    assert {path.name for path in page.iterdir()} == names


def test_every_executable_is_where_ros2_run_looks(prefix: Path) -> None:
    for name in ("table", "shoot", "demo", "simulate", "plan", "play", "benchmark"):
        assert os.access(prefix / "lib" / "billiards_sim" / name, os.X_OK)


def test_the_table_starts_from_the_prefix_and_takes_a_shot(prefix: Path, site: Site, tmp_path: Path) -> None:
    executables = prefix / "lib" / "billiards_sim"
    sourced = ["bash", "-c", 'source "$0"/local_setup.bash && exec "$@"', str(prefix.parent)]
    # Interpreted, as to compile the engine for this place would take longer than all else here.
    environment = {"PYTHONPATH": "", "PYTHONSAFEPATH": "1", "NUMBA_DISABLE_JIT": "1"}
    options = {"environment": environment, "directory": tmp_path}
    parameters = prefix / "share/billiards_sim/config/table.yaml"
    table = site.process(
        *(str(executables / "table"), "--ros-args", "--params-file", str(parameters)), command=sourced, **options
    )
    table.wait_for("ready: scene eight_ball, 16 balls, 100 Hz")
    shoot = site.process(str(executables / "shoot"), "--force", "80", "0", command=sourced, **options)
    assert shoot.wait() == 0, shoot.stderr
    for scene, live in (((), True), (("nine_ball",), False)):  # on this table, on an engine of its own
        arguments = str(executables / "play"), *scene, "--no-browser", "--port", "0"
        play = site.process(*arguments, command=sourced, **options)
        play.wait_for("(Ctrl-C")
        assert menu(play.stdout.split()[1])["live"] is live
        play.signal(signal.SIGINT)
        assert play.wait() == 0, play.stderr
    table.signal(signal.SIGINT)
    assert table.wait() == 0

    where = ["bash", "-c", 'source "$0"/local_setup.bash && exec "$@"', str(prefix.parent), sys.executable, "-c"]
    found = site.process("import billiards_sim; print(billiards_sim.__file__)", command=where, **options)
    assert found.wait() == 0
    assert found.stdout.startswith(str(prefix))
