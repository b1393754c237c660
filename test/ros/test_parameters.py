import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy
import yaml

import billiards_sim as bs
from billiards_sim.engine.quantity import quantities
from billiards_sim.ros import parameters
from billiards_sim.ros.table_node import TableNode

CONFIG = Path(__file__).parents[2] / "config"


def scene_file(directory: Path) -> str:
    path = directory / "two.yaml"
    scene = bs.Scene(
        [[0.5, 0.5], [1.0, 0.5]],  # type: ignore[arg-type]
        table=bs.Table(length=2.54),
        physics=bs.Physics(mass=0.17, sliding_friction=0.25),
    )
    bs.save_scene(scene, path)
    return str(path)


def test_without_parameters_the_defaults_hold() -> None:
    settings = parameters.read_settings({})
    assert settings.scene_name == "eight_ball"
    assert (settings.update_rate, settings.real_time_factor, settings.marker_rate) == (100.0, 1.0, 30.0)
    assert (settings.scene.physics, settings.scene.table) == (bs.Physics(), bs.Table())


def test_an_integer_is_a_number() -> None:
    settings = parameters.read_settings({"update_rate": 50, "physics.mass": 1})
    assert settings.update_rate == 50.0
    assert isinstance(settings.update_rate, float)
    assert settings.scene.physics.mass == 1.0


def test_parameters_replace_single_values_of_the_scene(tmp_path: Path) -> None:
    scene = parameters.read_settings({"scene": scene_file(tmp_path), "physics.sliding_friction": 0.3}).scene
    assert scene.physics == bs.Physics(mass=0.17, sliding_friction=0.3)
    assert scene.table == bs.Table(length=2.54)
    assert np.array_equal(scene.positions, [[0.5, 0.5], [1.0, 0.5]])


BAD = [
    ({"update_rate": "fast"}, "'update_rate' must be a number"),
    ({"update_rate": True}, "'update_rate' must be a number"),
    ({"update_rate": 0.0}, "'update_rate' must be a number"),
    ({"update_rate": float("nan")}, "'update_rate' must be a number"),
    ({"real_time_factor": -1.0}, "'real_time_factor' must be a number"),
    ({"marker_rate": -1}, "'marker_rate' must be a number"),
    ({"physics.mass": 0.0}, "'physics.mass' must be a number > 0"),
    ({"physics.rail_restitution": 1.5}, "got 1.5"),
    ({"physics.mas": 0.1}, "no parameter 'physics.mas'"),
    ({"table.length": [1.0]}, "'table.length' must be a number"),
    ({"scene": 3}, "'scene' must be a string"),
    ({"scene": "nine_ball"}, "neither a file nor one of head_on"),
    ({"scene": "/nowhere/scene.yaml"}, "neither a file nor one of head_on"),
    ({"physics.radius": 0.03}, "balls '1' and '2' overlap"),
    ({"table.length": 1.0}, "reaches"),
]


@pytest.mark.parametrize(("given", "reason"), BAD)
def test_bad_parameters_are_refused_with_the_reason(given: dict, reason: str) -> None:
    with pytest.raises(ValueError, match=re.escape(reason)):
        parameters.read_settings(given)


@pytest.mark.parametrize("text", ["balls: [", "balls: []", "\x00", "just words"])
def test_a_bad_scene_file_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match="parameter 'scene'"):
        parameters.read_settings({"scene": str(path)})


def test_the_config_file_holds_every_parameter_with_its_default() -> None:
    text = (CONFIG / "table.yaml").read_text()
    document = yaml.safe_load(text)
    assert list(document) == ["/**"]
    defaults = parameters.read_settings({})
    given = document["/**"]["ros__parameters"]
    assert given == {name: getattr(defaults, name) for name in parameters.RATES} | {"scene": "eight_ball"}
    whole = yaml.safe_load(re.sub(r"(?m)^    # (?=(  )?\w+:)", "    ", text))["/**"]["ros__parameters"]
    for group, owner in parameters.GROUPS.items():
        assert whole[group] == {field: getattr(owner(), field) for field in quantities(owner)}
    given = {f"{group}.{key}": value for group in parameters.GROUPS for key, value in whole[group].items()}
    assert parameters.read_settings(given).scene.physics == bs.Physics()


def test_help_names_every_parameter_with_default_and_unit() -> None:
    text = parameters.help_lines()
    names = [f"{group}.{field}" for group, owner in parameters.GROUPS.items() for field in quantities(owner)]
    for name in ("scene", *parameters.RATES, *names):
        assert f"\n  {name} (" in f"\n{text}"
    for part in ("update_rate (100 Hz, ", "physics.mass (0.16 kg, > 0): ", "physics.rolling_friction (0.01, >= 0): "):
        assert part in text


@pytest.fixture
def make_node() -> Iterator[Callable[..., TableNode]]:
    def make(*given: str) -> TableNode:
        rclpy.init(args=["table", "--ros-args", *(part for one in given for part in ("-p", one))])
        return TableNode()

    yield make
    rclpy.try_shutdown()


def test_the_node_shows_the_values_in_use(make_node: Callable[..., TableNode], tmp_path: Path) -> None:
    node = make_node(f"scene:={scene_file(tmp_path)}", "physics.sliding_friction:=1", "update_rate:=50")
    values = {name: node.get_parameter(name).value for name in ("physics.mass", "table.length", "physics.radius")}
    assert values == {"physics.mass": 0.17, "table.length": 2.54, "physics.radius": 0.028575}
    assert node.get_parameter("physics.sliding_friction").value == 1.0
    assert node.get_parameter("update_rate").value == 50.0


def test_every_parameter_is_described(make_node: Callable[..., TableNode]) -> None:
    node = make_node()
    for group, owner in parameters.GROUPS.items():
        for field, declared in quantities(owner).items():
            descriptor = node.describe_parameter(f"{group}.{field}")
            unit = "" if declared.unit == "1" else f", {declared.unit}"
            assert descriptor.description == declared.help + unit
            assert descriptor.additional_constraints == declared.bounds()
            assert descriptor.floating_point_range[0].to_value == declared.maximum
            assert descriptor.read_only


def test_ros_own_parameters_are_unharmed(make_node: Callable[..., TableNode]) -> None:
    node = make_node("use_sim_time:=true")
    assert node.get_parameter("use_sim_time").value is True
    result = node.set_parameters([rclpy.Parameter("use_sim_time", value=False)])[0]
    assert result.successful, result.reason


def test_a_parameter_of_nobody_is_named(make_node: Callable[..., TableNode]) -> None:
    assert parameters.unknown(make_node("update_rat:=5", "use_sim_time:=false")) == ["update_rat"]
