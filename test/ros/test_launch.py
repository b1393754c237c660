# SPDX-License-Identifier: Apache-2.0
"""The launch file names what exists. It is read, not run: launch and launch_ros have no wheels."""

import ast
from pathlib import Path

from billiards_sim.__main__ import EXECUTABLES

REPOSITORY = Path(__file__).parents[2]
FILE = ast.parse((REPOSITORY / "launch" / "table.launch.py").read_text())
CALLS = [node for node in ast.walk(FILE) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)]


def first_arguments(function: str) -> list[str]:
    return [call.args[0].value for call in CALLS if call.func.id == function]


def test_the_launch_file_has_what_launch_looks_for() -> None:
    compile(FILE, "table.launch.py", "exec")
    assert "generate_launch_description" in [node.name for node in FILE.body if isinstance(node, ast.FunctionDef)]


def test_every_argument_is_declared_and_used() -> None:
    declared = first_arguments("DeclareLaunchArgument")
    assert declared == ["scene", "params_file", "namespace", "rviz", "use_sim_time"]
    assert set(first_arguments("LaunchConfiguration")) == set(declared)
    page = (REPOSITORY / "docs" / "ros.md").read_text()
    assert all(f"`{name}`" in page.partition("table.launch.py")[2] for name in declared)


def test_nothing_is_left_running_where_rviz_is_not_installed() -> None:
    # launch ends at the first package that it does not find, and leaves alone what it has started before.
    (actions,) = [call.args[0].elts for call in CALLS if call.func.id == "LaunchDescription" and call.args]
    order = [action.func.id for action in actions]
    assert order.index("Node") < order.index("OpaqueFunction") == len(order) - 1


def test_every_executable_and_every_file_is_there() -> None:
    constants = {node.targets[0].id: node.value for node in FILE.body if isinstance(node, ast.Assign)}
    assert constants["PACKAGE"].value == "billiards_sim"
    nodes = [{word.arg: word.value for word in call.keywords} for call in CALLS if call.func.id == "Node"]
    own = [node["executable"].value for node in nodes if isinstance(node["package"], ast.Name)]
    others = [
        (node["package"].value, node["executable"].value) for node in nodes if not isinstance(node["package"], ast.Name)
    ]
    assert (own, others) == (["table"], [("rviz2", "rviz2")])
    assert set(own) <= set(EXECUTABLES)
    texts = [node.value for node in ast.walk(FILE) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    files = [text for text in texts if text.endswith((".yaml", ".rviz")) and " " not in text]
    assert sorted(files) == ["table.rviz", "table.yaml"]
    assert all((REPOSITORY / "config" / name).is_file() for name in files)
