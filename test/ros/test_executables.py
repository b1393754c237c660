# SPDX-License-Identifier: Apache-2.0
"""The executables as processes: arguments, exit codes, signals."""

import math
import os
import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest
from conftest import Site
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters

import billiards_sim as bs
from billiards_sim.command_line import STOPPING
from billiards_sim.ros.process import (
    FASTDDS_PROFILES,
    FASTDDS_VARIABLES,
    LAST_DOMAIN,
    Child,
    announce_often,
    claim_domain,
    isolate,
    noted_signals,
)
from billiards_sim.ros.wrench import wrench_from_shot

ROS_EXECUTABLES = ("table", "shoot", "demo")
EXECUTABLES = (*ROS_EXECUTABLES, "simulate")


def assert_one_line(text: str, start: str) -> None:
    assert text.startswith(start)
    assert text.count("\n") == 1
    assert text.endswith("\n")


@pytest.mark.parametrize("arguments", [(), ("tabel",)])
def test_without_a_known_name_the_names_are_listed(site: Site, arguments: tuple) -> None:
    process = site.process(*arguments)
    assert process.wait() == 2
    assert_one_line(process.stderr, "billiards_sim: ")
    assert all(name in process.stderr for name in EXECUTABLES)


@pytest.mark.parametrize("arguments", [("--help",), *((name, "--help") for name in EXECUTABLES)])
def test_help(site: Site, arguments: tuple) -> None:
    process = site.process(*arguments)
    assert process.wait() == 0
    assert process.stdout.startswith("usage: ")
    assert process.stderr == ""


@pytest.mark.parametrize("name", ROS_EXECUTABLES)
def test_without_rclpy_one_line_says_what_to_install(site: Site, tmp_path: Path, name: str) -> None:
    (tmp_path / "rclpy").mkdir()
    (tmp_path / "rclpy" / "__init__.py").write_text("raise ModuleNotFoundError(\"No module named 'rclpy'\")")
    process = site.process(name, environment={"PYTHONPATH": str(tmp_path)})
    assert process.wait() == 2
    assert_one_line(process.stderr, f"{name}: ")
    assert "pip install 'billiards_sim[ros]'" in process.stderr
    assert "source your ROS installation" in process.stderr


BAD_STARTS = [
    ("table", "--rate", "5"),
    ("table", "--ros-args", "--no-such-flag"),
    ("table", "--ros-args", "-p", "update_rate"),
    ("table", "--ros-args", "--params-file", "/nowhere.yaml"),
    ("table", "--ros-args", "-p", "update_rate:=fast"),
    ("table", "--ros-args", "-p", "physics.mass:=-1"),
    ("table", "--ros-args", "-p", "physics.rail_restitution:=1.5"),
    ("table", "--ros-args", "-p", "scene:=cowboy_pool"),
    ("table", "--ros-args", "-p", "scene:=/nowhere/scene.yaml"),
    ("table", "--ros-args", "-p", "table.length:=0.5"),
    ("shoot",),
    ("shoot", "--force", "80"),
    ("shoot", "--force", "hard", "0"),
    ("shoot", "--force", "80", "0", "--timeout", "0"),
    ("shoot", "--speed", "3"),
    ("shoot", "--angle", "12deg"),
    ("shoot", "--speed", "0", "--angle", "12deg"),
    ("shoot", "--speed", "nan", "--angle", "12deg"),
    ("shoot", "--speed", "3", "--angle", "12"),
    ("shoot", "--speed", "3", "--angle", "-12degrees"),
    ("shoot", "--speed", "3", "--angle", "12deg", "--force", "80", "0"),
    ("shoot", "--force", "80", "0", "--up", "0.1"),
    ("shoot", "--speed", "3", "--angle", "12deg", "--offset", "0", "0"),
    ("shoot", "--speed", "3", "--angle", "12deg", "--side", "0.8", "--up", "-0.6"),
    ("shoot", "--speed", "3", "--angle", "12deg", "--ball", "8"),
    ("shoot", "--speed", "3", "--angle", "12deg", "--preview", "--watch"),
    ("shoot", "--force", "80", "0", "--ros-args", "--no-such-flag"),
    ("demo", "--timeout", "soon"),
    ("demo", "now"),
    ("simulate", "cowboy_pool"),
    ("simulate", "head_on", "--solver", "euler"),
]


@pytest.mark.parametrize("arguments", BAD_STARTS, ids=" ".join)
def test_a_bad_start_is_one_line_and_code_2(site: Site, arguments: tuple) -> None:
    process = site.process(*arguments)
    assert process.wait() == 2
    assert_one_line(process.stderr, f"{arguments[0]}: ")
    assert process.stdout == ""


@pytest.mark.parametrize("domain", ["300", "233", "-1", 5000 * "9", "many"], ids=lambda given: given[:4])
@pytest.mark.parametrize("arguments", [("table",), ("shoot", "--force", "80", "0")], ids=" ".join)
def test_a_domain_that_is_none_is_one_line_and_code_2(site: Site, arguments: tuple, domain: str) -> None:
    process = site.process(*arguments, environment={"ROS_DOMAIN_ID": domain})
    assert process.wait() == 2
    assert_one_line(process.stderr, f"{arguments[0]}: ")
    assert "ROS_DOMAIN_ID" in process.stderr
    assert process.stdout == ""


@pytest.mark.parametrize("name", ROS_EXECUTABLES)
def test_an_argument_that_is_not_utf_8_is_one_line_and_code_2(site: Site, name: str) -> None:
    process = site.process(name, os.fsdecode(b"scene:=\xff"))
    assert process.wait() == 2
    assert_one_line(process.stderr, f"{name}: arguments must be UTF-8, got b'scene:=\\xff'")


SHOT = ("shoot", "--force", "80", "0", "--timeout", "0.5")


@pytest.mark.parametrize("arguments", [SHOT, ("demo",)], ids=lambda given: given[0])
def test_a_full_device_for_an_output_is_one_line_and_code_1(site: Site, arguments: tuple) -> None:
    with open("/dev/full", "wb") as device:
        process = site.process(*arguments, stdout=device)
        assert process.wait() == 1
    assert_one_line(process.stderr, f"{arguments[0]}: cannot write to stdout: No space left on device")


@pytest.mark.parametrize("arguments", [SHOT, ("demo",)], ids=lambda given: given[0])
def test_an_output_that_nobody_reads_ends_it_quietly(site: Site, arguments: tuple) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        process = site.process(*arguments, stdout=writer)
        assert process.wait() == 1
    finally:
        os.close(writer)
    assert process.stderr == ""


@pytest.mark.parametrize("number", STOPPING)
@pytest.mark.parametrize(("name", "code", "told"), [("table", 0, ""), ("shoot", 1, "shoot: stopped\n")])
def test_a_signal_during_the_imports_ends_it_quietly(
    site: Site, tmp_path: Path, name: str, code: int, told: str, number: int
) -> None:
    (tmp_path / "rclpy").mkdir()
    (tmp_path / "rclpy" / "__init__.py").write_text(f"import os\nos.kill(os.getpid(), {int(number)})\n")
    process = site.process(name, environment={"PYTHONPATH": str(tmp_path)})
    assert process.wait() == code
    assert (process.stdout, process.stderr) == ("", told)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_the_table_with_code_0(site: Site, number: int) -> None:
    table = site.process("table")
    table.wait_for("ready: ")
    table.signal(number)
    table.signal(number)  # nor does an impatient second one disturb it
    assert table.wait() == 0, table.stderr
    assert "Traceback" not in table.stderr


@pytest.mark.parametrize("attempt", range(4))
def test_sigterm_ends_a_busy_table_with_code_0(site: Site, attempt: int) -> None:
    table = site.table("update_rate:=1000")
    client = site.client()
    shot = wrench_from_shot((80.0, 1.0, 0.0), (0.0, 0.0))
    for _ in range(100):
        client.asker.publish(shot)
        client.cue.publish(shot)
    client.spin_until(lambda: client.previews)
    table.signal(signal.SIGTERM)
    assert table.wait() == 0
    assert "Traceback" not in table.stderr


def test_a_request_that_rclpy_chokes_on_does_not_end_the_table(site: Site) -> None:
    table = site.table()
    client = site.client()
    setter = client.node.create_client(SetParameters, "table/set_parameters")
    client.spin_until(setter.service_is_ready)
    nonsense = SetParameters.Request(parameters=[Parameter(name="update_rate", value=ParameterValue(type=77))])
    setter.call_async(nonsense)
    table.wait_for("a request cannot be served: ")
    assert client.get_parameters("update_rate") == [100.0]
    assert client.shoot(wrench_from_shot((80.0, 1.0, 0.0), (0.0, 0.0)))["accepted"]


def test_the_middleware_understands_its_settings(site: Site) -> None:
    table = site.table()
    table.signal(signal.SIGINT)
    assert table.wait() == 0
    assert "XML" not in table.stdout + table.stderr  # Fast DDS complains of what it cannot read


def test_whoever_configures_the_middleware_is_left_alone() -> None:
    environment = {"HOME": "/"}
    announce_often(environment)
    assert environment == {"HOME": "/", "FASTRTPS_DEFAULT_PROFILES_FILE": str(FASTDDS_PROFILES)}
    for name in FASTDDS_VARIABLES:
        environment = {name: "mine.xml"}
        announce_often(environment)
        assert environment == {name: "mine.xml"}


def test_shoot_without_a_table_gives_up(site: Site) -> None:
    shoot = site.process("shoot", "--force", "80", "0", "--timeout", "0.5")
    assert shoot.wait() == 1
    assert_one_line(shoot.stderr, "shoot: no table listens on /cue_shot within 0.5 s")


def test_shoot_in_words_without_a_table_gives_up(site: Site) -> None:
    shoot = site.process("shoot", "--speed", "3", "--angle", "-12deg", "--timeout", "0.5")
    assert shoot.wait() == 1
    assert_one_line(shoot.stderr, "shoot: no table listens on /cue_shot within 0.5 s")


def deepest_press(physics: bs.Physics, energy: float) -> float:
    """How deep two balls can press each other with an energy, J: Hertz' elastic energy is 2/5 K d^(5/2); m."""
    if physics.youngs_modulus == 0.0:
        return 1e-9
    modulus = physics.youngs_modulus / (2.0 * (1.0 - physics.poisson_ratio**2))
    return (2.5 * energy / (4.0 / 3.0 * modulus * math.sqrt(physics.radius / 2.0))) ** 0.4


def test_demo_breaks_a_rack(site: Site) -> None:
    scene = bs.scenes.eight_ball()
    demo = site.process("demo")
    assert demo.wait() == 0, demo.stderr
    assert "the cue hits ball cue with 1.4" in demo.stdout
    summary = demo.stdout.partition("demo: summary\n")[2]
    lines = dict(line.strip().split("  ", 1) for line in summary.splitlines())
    assert lines["balls"].split() == ["16"]
    assert int(lines["collisions"].split()[0]) >= 15
    assert 2.0 < float(lines["time to rest"].split()[0]) < 60.0
    overlap, *_, bound, _, _ = lines["largest overlap"].split()
    deepest = deepest_press(scene.physics, 0.5 * scene.physics.mass * 8.5**2)  # at the cue; on the way it gets slower
    assert 0.8 * deepest < float(bound) < deepest
    assert float(overlap) <= float(bound)
    # The scene's own shot does the same, wherever it is played.
    simulation = bs.Simulation(scene)
    simulation.strike(scene.shot.force, scene.shot.offset)
    events = simulation.run()
    fell = [f"{event.balls[0]} in {event.pocket}" for event in events if event.kind == "pocketed"]
    assert lines["pocketed"].strip() == (", ".join(fell) or "none")
    moved = np.hypot(*(simulation.positions - scene.positions)[1:].T)
    assert float(lines["spread"].split()[0]) == pytest.approx(np.median(moved), abs=0.006)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT])
@pytest.mark.parametrize("when", ["starting a 9 ft table", "ready: "])
def test_an_interrupted_demo_takes_its_children_along(site: Site, number: int, when: str) -> None:
    demo = site.process("demo")
    demo.wait_for(when)
    demo.signal(number)
    # The table holds the demo's stderr open: reading to its end waits for the table, too.
    assert demo.wait() == 1
    assert "demo: stopped" in demo.stderr
    assert "Traceback" not in demo.stderr


def test_a_signal_in_the_middle_of_a_start_leaves_no_child_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    start = subprocess.Popen

    def start_and_signal(*given: object, **options: object) -> subprocess.Popen:
        child = start(*given, **options)
        os.kill(os.getpid(), signal.SIGINT)
        return child

    monkeypatch.setattr(subprocess, "Popen", start_and_signal)
    before = {number: signal.getsignal(number) for number in STOPPING}
    try:
        with noted_signals() as came:
            assert came == []
            with Child("table") as child:
                assert came == [signal.SIGINT]
                assert child.exit_code is None
            assert child.exit_code is not None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_demo_leaves_a_table_in_the_users_domain_alone(site: Site) -> None:
    site.table()
    client = site.client()
    demo = site.process("demo", environment={"ROS_DOMAIN_ID": str(site.domain)})
    assert demo.wait() == 0, demo.stderr
    client.fresh_poses()
    assert (client.results, client.at_rest) == ([], [True])


def test_a_domain_is_claimed_by_one_alone_until_it_is_given_back() -> None:
    start = os.getpid() + LAST_DOMAIN // 2  # far from where the other tests look
    first, claim = claim_domain(start)
    second, other = claim_domain(start)
    assert first != second
    claim.close()
    again, claim = claim_domain(start)
    assert again == first
    claim.close()
    third, claim = claim_domain(start, taken=str(first))
    assert third not in (first, second)
    claim.close()
    other.close()


def test_a_domain_of_ones_own_is_not_the_users() -> None:
    environment: dict[str, str] = {}
    isolate(environment)
    own = environment["ROS_DOMAIN_ID"]
    isolate(environment)
    assert environment["ROS_DOMAIN_ID"] != own
    assert 1 <= int(own) <= LAST_DOMAIN
    assert 1 <= int(environment["ROS_DOMAIN_ID"]) <= LAST_DOMAIN
