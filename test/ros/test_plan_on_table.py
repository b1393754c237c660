# SPDX-License-Identifier: Apache-2.0
"""`plan --ros` and a table in a process of its own: it plans for the balls that lie there, and what it shoots falls."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
import yaml
from conftest import Site
from geometry_msgs.msg import Transform, WrenchStamped
from process import Client, positions
from sensor_msgs.msg import MultiDOFJointState
from test_command_lines import arguments, filled

from billiards_sim.ros.tools import plan as tool
from billiards_sim.ros.tools.shoot import NoAnswer
from billiards_sim.study import plan

SCENE = """
table: pool_9ft
physics: pool
balls:
  - {name: cue, position: [1.5, 0.9]}
  - {name: "1", position: [2.1, 1.0]}
  - {name: "3", position: [0.6, 0.4]}
"""

QUICK = ("--budget", "10000", "--samples", "100", "--best", "2")


@pytest.fixture(scope="module")
def client(shared_site: Site, tmp_path_factory: pytest.TempPathFactory) -> Client:
    path = tmp_path_factory.mktemp("plan") / "scene.yaml"
    path.write_text(SCENE, encoding="utf-8")
    shared_site.table(f"scene:={path}", "real_time_factor:=10.0")
    return shared_site.client()


@pytest.fixture
def table(client: Client) -> Client:
    """At rest at the start."""
    assert client.reset().success
    client.spin_until(lambda: client.at_rest[-1])
    client.collisions.clear()
    client.results.clear()
    return client


def places(**balls: tuple[float, float]) -> MultiDOFJointState:
    message = MultiDOFJointState()
    for name, (x, y) in balls.items():
        transform = Transform()
        transform.translation.x, transform.translation.y = x, y
        message.joint_names.append(name)
        message.transforms.append(transform)
    return message


def shots(table: Client) -> list[dict]:
    """Verdicts by now. Those that were sent before the next states have come with them."""
    table.fresh_poses(2)
    return table.results


def test_what_it_shoots_falls_and_ends_where_it_said(table: Client, shared_site: Site) -> None:
    process = shared_site.process("plan", "--ros", "--shoot", "--noise", "0", *QUICK)
    assert process.wait() == 0, process.stderr
    (line,) = re.findall(r"(?m)^  1  .*$", process.stdout)
    _, ball, pocket, *_, end = re.split(r"\s{2,}", line.strip())
    assert re.search(r"plan: shot 1 accepted at [\d.]+ s of the table's time\n$", process.stdout)
    table.spin_until(lambda: table.collisions and table.collisions[-1]["kind"] == "rest" and table.at_rest[-1])
    fell = [(event["balls"], event["pocket"]) for event in table.collisions if event["kind"] == "pocketed"]
    assert ([ball], pocket) in fell
    x, y, _ = (float(text) for text in re.findall(r"[\d.]+", end))
    assert positions(table.fresh_poses()[0])[0] == pytest.approx((x, y), abs=0.0051)


def test_it_plans_for_the_balls_that_lie_there(table: Client, shared_site: Site, tmp_path: Path) -> None:
    """The same as of a scene with these balls, whose constants are the table's."""
    assert table.set_balls(places(cue=(0.7, 0.5), **{"3": (1.1, 1.1)}))["accepted"]
    process = shared_site.process("plan", "--ros", *QUICK)
    assert process.wait() == 0, process.stderr
    path = tmp_path / "moved.yaml"
    path.write_text(
        "table: pool_9ft\nphysics: pool\nballs:\n"
        '  - {name: cue, position: [0.7, 0.5]}\n  - {name: "3", position: [1.1, 1.1]}\n'
    )
    alone = shared_site.process("plan", str(path), *QUICK)
    assert alone.wait() == 0, alone.stderr
    assert process.stdout == alone.stdout
    assert shots(table) == []  # without --shoot


def test_the_message_is_taken_by_a_table_as_the_documents_say(table: Client, shared_site: Site, tmp_path: Path) -> None:
    (given,) = [words for words in arguments("ros2", "topic", "pub") if words[-1].startswith("$(cat ")]
    once, wait, one, topic, kind, text = given
    assert (once, wait, one, topic, kind) == ("--once", "-w", "1", "/cue_shot", "geometry_msgs/msg/WrenchStamped")
    path = tmp_path / text.removeprefix("$(cat ").removesuffix(")")
    process = shared_site.process("plan", "--ros", "--yaml", str(path), *QUICK)
    assert process.wait() == 0, process.stderr
    (ball,) = re.findall(r"(?m)^  1  (\S+)", process.stdout)
    message = filled(WrenchStamped, yaml.safe_load(path.read_text(encoding="utf-8")))
    assert table.shoot(message)["accepted"]
    table.spin_until(lambda: any(event["pocket"] and event["balls"] == [ball] for event in table.collisions))


@pytest.mark.parametrize("given", arguments("ros2", "run", "billiards_sim", "plan"), ids=" ".join)
def test_it_does_what_is_printed(table: Client, shared_site: Site, given: tuple[str, ...]) -> None:
    process = shared_site.process("plan", *given)
    assert process.wait() == 0, process.stderr
    assert "shots played\n" in process.stdout
    assert ("shot 1 accepted" in process.stdout) == ("--shoot" in given)
    assert len(shots(table)) == ("--shoot" in given)


@pytest.fixture
def here(shared_site: Site) -> Iterator[None]:
    """Nodes of this process are in the domain of the table."""
    rclpy.init(domain_id=shared_site.domain)
    yield
    rclpy.shutdown()


def test_it_does_not_shoot_at_balls_that_somebody_moved(
    table: Client, here: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def planned_and_moved(*given: object) -> plan.Plan:
        made = plan.plan(*given)  # type: ignore[arg-type]
        assert table.set_balls(places(cue=(1.5, 0.9), **{"1": (2.1, 1.001), "3": (0.6, 0.4)}))["accepted"]
        return made

    monkeypatch.setattr(tool, "plan", planned_and_moved)
    options = plan.parser().parse_args(["--ros", "--shoot", *QUICK])
    with pytest.raises(NoAnswer, match="^somebody moved the balls while the plan was made: plan again$"):
        tool._play(options)
    assert shots(table) == []


def test_balls_that_move_are_waited_for(table: Client, shared_site: Site) -> None:
    assert table.pause(True).success
    hard = filled(WrenchStamped, {"wrench": {"force": {"x": 300.0, "y": 0.0, "z": 0.0}}})
    assert table.shoot(hard)["accepted"]
    process = shared_site.process("plan", "--ros", *QUICK)
    process.wait_for("plan: balls move; waiting up to 60 s for all to rest\n")
    assert table.pause(False).success
    assert process.wait() == 0, process.stderr
    assert re.search(r"(?m)^  1  ", process.stdout)


def test_a_ball_that_is_not_there_is_one_line(table: Client, shared_site: Site) -> None:
    assert table.set_balls(places(**{"1": (0.7, 0.5)}))["accepted"]
    process = shared_site.process("plan", "--ros", "--shoot")
    assert process.wait() == 2
    assert process.stderr == "plan: no ball is named 'cue'; the balls are 1\n"


@pytest.mark.parametrize(
    ("given", "code", "said"),
    [
        (("--timeout", "0.5"), 1, "plan: no table listens on /cue_shot within 0.5 s\n"),
        (("nine_ball",), 2, "plan: --ros plans for the balls on the running table: leave out 'nine_ball'\n"),
        (("--yaml", "/no/such/place"), 2, "plan: --yaml: cannot write '/no/such/place': no directory '/no/such'\n"),
    ],
)
def test_what_cannot_be_is_one_line(site: Site, given: tuple[str, ...], code: int, said: str) -> None:
    process = site.process("plan", "--ros", *given)
    assert process.wait() == code
    assert (process.stdout, process.stderr) == ("", said)


def test_a_signal_ends_it(site: Site) -> None:
    process = site.process("plan", "--ros", "--timeout", "60")
    site.table("scene:=nine_ball", "real_time_factor:=0.01").close()  # by now the other one is past its imports
    process.signal(15)
    assert process.wait() == 1
    assert process.stderr == "plan: stopped\n"
