# SPDX-License-Identifier: Apache-2.0
"""What a package of its kind is expected to have."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

REPOSITORY = Path(__file__).parents[1]
SPDX = "# SPDX-License-Identifier: Apache-2.0"
SUFFIXES = (".py", ".yaml", ".toml", ".cfg", ".sh")
EXTRAS = (
    "gymnasium",
    "imageio_ffmpeg",
    "matplotlib",
    "mpmath",
    "mujoco",
    "nbclient",
    "numba",
    "PIL",
    "playwright",
    "pymunk",
    "scipy",
    "tqdm",
)
"""Modules that package.xml does not ask for: `colcon test` has to go without them."""


def sources() -> list[Path]:
    """Every file of ours that can hold a comment with `#`, relative to the repository."""
    files = [path for path in REPOSITORY.iterdir() if path.is_file()]
    for directory in ("billiards_sim", "config", "launch", "test"):
        files += (REPOSITORY / directory).rglob("*")
    files = [path for path in files if path.suffix in SUFFIXES or path.name == "Makefile"]
    return sorted(path.relative_to(REPOSITORY) for path in files)


def test_every_source_file_names_its_licence_at_the_top() -> None:
    found = sources()
    assert Path(__file__).relative_to(REPOSITORY) in found
    heads = {str(path): (REPOSITORY / path).read_text(encoding="utf-8").splitlines()[:2] for path in found}
    assert [path for path, head in heads.items() if SPDX not in head] == []


def test_every_ros_package_that_is_imported_is_asked_for() -> None:
    asked = {one.text for one in ElementTree.parse(REPOSITORY / "package.xml").getroot().iter("exec_depend")}
    imported = set()
    for path in (REPOSITORY / "billiards_sim").rglob("*.py"):
        for line in path.read_text(encoding="utf-8").splitlines():
            if found := re.match(r" *(?:from|import) (rclpy|\w+_msgs|\w+_interfaces|std_srvs)\b", line):
                imported.add(found[1])
    assert imported >= {"rclpy", "sensor_msgs", "tf2_msgs", "std_srvs", "builtin_interfaces"}
    assert imported <= asked


def test_every_test_can_be_collected_with_the_dependencies_of_a_robot_alone() -> None:
    pytest.importorskip("rclpy")
    collect = f"""
import sys, pytest
sys.modules.update(dict.fromkeys({EXTRAS}))
sys.exit(pytest.main(["--collect-only", "-q", "-p", "no:cacheprovider", "test"]))
"""
    done = subprocess.run(
        [sys.executable, "-c", collect], cwd=REPOSITORY, capture_output=True, text=True, timeout=120.0, check=False
    )
    assert done.returncode == 0, done.stdout[-3000:]


def test_version_and_licence_are_the_same_everywhere() -> None:
    package = ElementTree.parse(REPOSITORY / "package.xml").getroot()
    setup = (REPOSITORY / "setup.py").read_text(encoding="utf-8")
    assert f'version="{package.findtext("version")}"' in setup
    assert f'license="{package.findtext("license")}"' in setup
    changes = (REPOSITORY / "CHANGELOG.rst").read_text(encoding="utf-8")
    assert f"Changelog for package {package.findtext('name')}\n" in changes
