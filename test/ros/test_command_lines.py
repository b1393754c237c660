# SPDX-License-Identifier: Apache-2.0
"""Every command line for ROS in the documents does what it says, or names what is there."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from conftest import Site
from documents import REPOSITORY, command_lines, complete
from process import TIMEOUT, Client

ANSWERS = {
    "cue_shot": "shot_result",
    "cue_shot/preview": "preview/result",
    "place_balls": "placement_result",
    "set_balls": "placement_result",
}
"""Where the table says what it thinks of a message."""


def title(words: tuple[str, ...]) -> str:
    return " ".join(words)


def arguments(*program: str) -> list[tuple[str, ...]]:
    """Those of every command line of a program."""
    return [words[len(program) :] for words in complete(command_lines(*program))]


class Hall:
    """Tables with two balls at rest, one a namespace, and a client of each; they start when they are asked for."""

    def __init__(self, site: Site) -> None:
        self.site = site
        self._clients: dict[str, Client] = {}

    def client(self, namespace: str = "") -> Client:
        """Of the table in a namespace, back at the start and running."""
        if namespace not in self._clients:
            self.site.table("scene:=head_on", "real_time_factor:=50.0", remap=f"__ns:=/{namespace}")
            self._clients[namespace] = self.site.client(namespace)
        client = self._clients[namespace]
        assert client.pause(False).success
        assert client.reset().success
        client.spin_until(lambda: client.at_rest[-1])
        return client


@pytest.fixture(scope="module")
def hall(shared_site: Site) -> Iterator[Hall]:
    return Hall(shared_site)


def split(name: str, ends: list[str]) -> tuple[str, str]:
    """Namespace of a table and name in it, of a name that begins with a slash and ends with one of these."""
    (end,) = [end for end in sorted(ends, key=len)[::-1] if f"{name}/".endswith(f"/{end}/")][:1] or [""]
    assert end, f"{name} is none of {ends}"
    return name[: -len(end)].strip("/"), end


def found(kind: str) -> type:
    """The class of `package/msg/Name` or `package/srv/Name`."""
    package, group, name = kind.split("/")
    return getattr(importlib.import_module(f"{package}.{group}"), name)


def filled(kind: type, values: dict[str, Any]) -> Any:
    """A message with the fields of a mapping, as `ros2` fills it."""
    message = kind()
    types = kind.get_fields_and_field_types()
    for name, value in values.items():
        if isinstance(value, dict):
            value = filled(type(getattr(message, name)), value)
        elif isinstance(value, list) and "/" in types[name]:
            package, _, element = types[name].removeprefix("sequence<").rstrip(">").partition("/")
            value = [filled(found(f"{package}/msg/{element}"), one) for one in value]
        setattr(message, name, value)
    return message


@pytest.mark.parametrize("given", arguments("ros2", "run", "billiards_sim", "shoot") + arguments("shoot"), ids=title)
def test_shoot(hall: Hall, given: tuple[str, ...]) -> None:
    namespace = given[-1].partition("__ns:=/")[2] if given[-1].startswith("__ns") else ""
    hall.client(namespace)
    shoot = hall.site.process("shoot", *given)
    assert shoot.wait() == 0, shoot.stderr
    assert "accepted" in shoot.stdout
    assert ("at rest after" in shoot.stdout) == ("--watch" in given or "--preview" in given)


@pytest.mark.parametrize(
    "given",
    arguments("ros2", "run", "billiards_sim", "table") + arguments("python3", "-m", "billiards_sim", "table"),
    ids=title,
)
def test_table(site: Site, tmp_path: Path, given: tuple[str, ...]) -> None:
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "billiards_sim").symlink_to(REPOSITORY)
    site.process("table", *given, directory=tmp_path).wait_for("ready: ")


@pytest.mark.parametrize(
    "given",
    [
        words for words in arguments("ros2", "topic", "pub") if not words[-1].startswith("$(cat ")
    ],  # see test_plan_on_table.py
    ids=title,
)
def test_topic_pub(hall: Hall, given: tuple[str, ...]) -> None:
    once, wait, one, topic, kind, text = given
    assert (once, wait, one) == ("--once", "-w", "1")
    namespace, name = split(topic, list(ANSWERS))
    client = hall.client(namespace)
    listener = client.node.get_subscriptions_info_by_topic(topic)
    assert [end.topic_type for end in listener] == [kind]
    publisher = client.node.create_publisher(found(kind), topic, 10)
    client.spin_until(lambda: publisher.get_subscription_count() == 1)
    heard = {"shot_result": client.results, "preview/result": client.previews, "placement_result": client.placements}
    answers = heard[ANSWERS[name]]
    before = len(answers)
    publisher.publish(filled(found(kind), yaml.safe_load(text)))
    client.spin_until(lambda: len(answers) > before)
    assert answers[-1]["accepted"], answers[-1]["reason"]


@pytest.mark.parametrize("given", arguments("ros2", "topic", "echo"), ids=title)
def test_topic_echo(hall: Hall, given: tuple[str, ...]) -> None:
    *options, topic = given
    publishers = hall.client().node.get_publishers_info_by_topic(topic)
    assert len(publishers) == 1
    assert ("--full-length" in options) == (publishers[0].topic_type == "std_msgs/msg/String")
    assert set(options) <= {"--full-length", "--once", "--field", "data"}


@pytest.mark.parametrize("given", arguments("ros2", "bag", "record"), ids=title)
def test_bag_record(hall: Hall, given: tuple[str, ...]) -> None:
    node = hall.client().node
    assert [topic for topic in given if len(node.get_publishers_info_by_topic(topic)) != 1] == []


def test_service_call_in_the_order_of_the_documents(hall: Hall) -> None:
    lines = arguments("ros2", "service", "call")
    assert len(lines) > 3
    spaces = {split(name, ["table/reset", "table/pause", "table/step"])[0] for name, *_ in lines}
    clients = {space: hall.client(space) for space in spaces}
    for name, kind, *text in lines:
        client = clients[split(name, ["table/reset", "table/pause", "table/step"])[0]]
        assert dict(client.node.get_service_names_and_types())[name] == [kind]
        caller = client.node.create_client(found(kind), name)
        client.spin_until(caller.service_is_ready)
        answer = caller.call_async(filled(found(kind).Request, yaml.safe_load(*text) if text else {}))
        client.spin_until(answer.done, TIMEOUT)
        assert answer.result().success, answer.result().message


@pytest.mark.parametrize("given", arguments("ros2", "param", "set"), ids=title)
def test_param_set(hall: Hall, given: tuple[str, ...]) -> None:
    node, name, value = given
    namespace, _ = split(node, ["table"])
    (result,) = hall.client(namespace).set_parameters(**{name: yaml.safe_load(value)})
    assert result.successful, result.reason


def test_rviz_is_given_a_file_of_the_package() -> None:
    for path, *_ in arguments("rviz2", "-d"):
        inside = path.removeprefix("install/billiards_sim/share/billiards_sim/")
        assert inside != path
        assert (REPOSITORY / inside).is_file()


def test_launch_is_given_a_file_of_the_package() -> None:
    for file, *given in arguments("ros2", "launch", "billiards_sim"):
        text = (REPOSITORY / "launch" / file).read_text(encoding="utf-8")
        assert [one for one in given if f'"{one.partition(":=")[0]}"' not in text] == []
