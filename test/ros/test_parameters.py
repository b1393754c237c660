# SPDX-License-Identifier: Apache-2.0
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rclpy
import yaml
from std_srvs.srv import Trigger

import billiards_sim as bs
from billiards_sim.engine.quantity import quantities
from billiards_sim.ros import parameters, table_node
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
    assert (settings.scene.physics, settings.scene.table) == (bs.Physics.pool(), bs.Table.pool_9ft())
    assert len(settings.scene) == 16


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
    ({"publish_clock": 1}, "'publish_clock' must be true or false, got 1"),
    ({"frame_id": 3}, "'frame_id' must be a string"),
    ({"frame_id": ""}, "'frame_id' must not be empty"),
    ({"frame_id": "/table"}, "'frame_id' must be a string without space at its ends and without '/' in front"),
    ({"frame_prefix": "left "}, "'frame_prefix' must be a string without space at its ends"),
    ({"frame_prefix": "a\nb"}, "'frame_prefix' must be a string"),
    ({"frame_prefix": "x" * 201}, "'frame_prefix' must have at most 200 characters, got 201"),
    ({"frame_id": "cue", "publish_tf": True}, "cannot both have the frame 'cue'"),
    ({"physics.mass": 0.0}, "'physics.mass' must be a number >= 1e-06"),
    ({"physics.rail_restitution": 1.5}, "got 1.5"),
    ({"physics.mas": 0.1}, "no parameter 'physics.mas'; under 'physics' there are preset, mass, "),
    (
        {"physics.preset": "billiards"},
        "parameter 'physics.preset' must be one of pool, snooker, carom, got 'billiards'",
    ),
    ({"physics.preset": 3}, "parameter 'physics.preset' must be one of pool, snooker, carom, got 3"),
    ({"table.preset": "pool"}, "parameter 'table.preset' must be one of pool_9ft, pool_8ft, pool_7ft, "),
    ({"table.lenght": 1.0}, "no parameter 'table.lenght'; under 'table' there are preset, length, "),
    (
        {"scene": "rack", "table.side_pocket.mouth": 0.1},
        "there is no table.side_pocket: to make one give it cut_angle, shelf, point_radius, slate_radius, too",
    ),
    (
        {"scene": "eight_ball", "table.corner_pocket.mouth": 0.05},
        "pocket x_min_y_min: its mouth of 0.05 m must be wider than a ball of 0.05715 m",
    ),
    (
        {"scene": "eight_ball", "table.corner_pocket.cut_angle": 0.1},
        "parameter 'table.corner_pocket.cut_angle' must be a number >= 1.5708, <= 3 (rad), got 0.1",
    ),
    (
        {"scene": "eight_ball", "table.corner_pocket.mouth": False},
        "parameter 'table.corner_pocket.mouth' must be a number > 0, <= 10000 (m), got False",
    ),
    ({"table.length": [1.0]}, "'table.length' must be a number"),
    ({"scene": 3}, "'scene' must be a string"),
    ({"scene": "cowboy_pool"}, "neither a file nor one of head_on"),
    ({"scene": "/nowhere/scene.yaml"}, "neither a file nor one of head_on"),
    ({"scene": "rack", "table.length": 0.5}, "scene 'rack' does not fit these physics and table parameters: ball"),
    ({"scene": "rack", "physics.radius": 0.6}, "balls of radius 0.6 m do not fit on a table 1.17 m wide"),
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


@pytest.mark.parametrize(("count", "taken"), [(100, True), (101, False), (20_000, False)])
def test_a_table_takes_a_bounded_number_of_balls(tmp_path: Path, count: int, taken: bool) -> None:
    balls = (f"  - {{name: b{index}, position: [{0.1 + 0.1 * index}, 0.5]}}\n" for index in range(count))
    path = tmp_path / "scene.yaml"
    path.write_text("table: {length: 2100}\nballs:\n" + "".join(balls))
    if taken:
        assert len(parameters.read_settings({"scene": str(path)}).scene) == count
        return
    with pytest.raises(ValueError, match=r"parameter 'scene': .*scene.yaml: .* 100 balls"):
        parameters.read_settings({"scene": str(path)})


def test_the_config_file_holds_every_parameter_with_its_default() -> None:
    text = (CONFIG / "table.yaml").read_text()
    document = yaml.safe_load(text)
    assert list(document) == ["/**"]
    defaults = parameters.read_settings({})
    given = document["/**"]["ros__parameters"]
    names = (*parameters.NUMBERS, *parameters.SWITCHES, *parameters.TEXTS)
    zeros = dict.fromkeys(quantities(bs.Pocket), 0.0)
    presets = {"physics": {"preset": ""}, "table": {"preset": "", "corner_pocket": zeros, "side_pocket": zeros}}
    assert given == {name: getattr(defaults, name) for name in names} | {"scene": "eight_ball"}
    whole = yaml.safe_load(re.sub(r"(?m)^    # (?=(  )*\w+:)", "    ", text))["/**"]["ros__parameters"]
    for group, owner in parameters.GROUPS.items():
        assert whole[group] == presets[group] | {field: getattr(owner(), field) for field in quantities(owner)}
    read = parameters.read_settings(flat({group: whole[group] for group in parameters.GROUPS})).scene
    assert (read.physics, read.table) == (bs.Physics(), bs.Table())


def flat(values: dict, prefix: str = "") -> dict:
    """Parameters by name, of a file's groups."""
    found = {}
    for key, value in values.items():
        found |= flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return found


def test_a_preset_is_a_table_with_its_pockets() -> None:
    for name, make in (("pool_7ft", bs.Table.pool_7ft), ("snooker_12ft", bs.Table.snooker_12ft)):
        settings = parameters.read_settings({"scene": "rack", "table.preset": name, "physics.preset": "snooker"})
        assert settings.scene.table == make()
        assert settings.values()["table.corner_pocket.mouth"] == make().corner_pocket.mouth
        assert settings.values()["table.preset"] == name
    assert parameters.read_settings({"scene": "eight_ball", "table.preset": "carom_10ft"}).scene.table.mouths == ()


def test_single_values_of_a_pocket_replace_those_of_the_table() -> None:
    given = {"scene": "eight_ball", "table.corner_pocket.mouth": 0.12, "table.side_pocket.shelf": 0}
    table = parameters.read_settings(given).scene.table
    preset = bs.Table.pool_9ft()
    assert table == replace(
        preset,
        corner_pocket=replace(preset.corner_pocket, mouth=0.12),
        side_pocket=replace(preset.side_pocket, shelf=0.0),
    )


def test_a_mouth_of_0_takes_the_pockets_away() -> None:
    given = {"scene": "eight_ball", "table.side_pocket.mouth": 0}
    settings = parameters.read_settings(given)
    assert settings.scene.table == bs.Table.pool_9ft(side_pocket=None)
    sides = [value for name, value in settings.values().items() if name.startswith("table.side_pocket.")]
    assert sides == [0.0] * len(quantities(bs.Pocket))


def test_pockets_can_be_given_to_a_table_without() -> None:
    pocket = bs.Table.pool_9ft().corner_pocket
    given = {f"table.corner_pocket.{key}": getattr(pocket, key) for key in quantities(bs.Pocket)}
    assert parameters.read_settings({"scene": "rack", "table.rail_thickness": 0.127, **given}).scene.table == bs.Table(
        rail_thickness=0.127, corner_pocket=pocket
    )


@pytest.mark.parametrize("scene", ["rack", "eight_ball", "snooker", "three_cushion"])
def test_what_is_shown_can_be_given_back(scene: str) -> None:
    settings = parameters.read_settings({"scene": scene})
    again = parameters.read_settings(settings.values())
    assert again.scene == settings.scene
    assert again.values() == settings.values()


POOL = {"pool_9ft.yaml": (100, 50), "pool_8ft.yaml": (92, 46), "pool_7ft.yaml": (78, 39)}
"""Playing areas, inches."""


@pytest.mark.parametrize("name", POOL)
def test_pool_tables_are_within_the_specification(name: str) -> None:
    document = yaml.safe_load((CONFIG / name).read_text())
    assert list(document) == ["/**"]
    groups = document["/**"]["ros__parameters"]
    given = {"scene": groups["scene"]}
    given |= {f"{group}.{key}": value for group in parameters.GROUPS for key, value in groups[group].items()}
    scene = parameters.read_settings(given).scene
    inches = (scene.table.length / 0.0254, scene.table.width / 0.0254)
    assert inches == pytest.approx(POOL[name], abs=1e-9)
    assert 4.0 <= scene.table.rail_thickness / 0.0254 <= 7.5
    assert 2.0 * scene.physics.radius == pytest.approx(2.25 * 0.0254, abs=1e-12)
    assert 5.5 <= scene.physics.mass / 0.028349523125 <= 6.0
    assert 0.625 <= scene.table.nose_height <= 0.645
    assert scene.physics == bs.Physics.pool()
    assert scene.positions[1] == pytest.approx(scene.table.foot_spot, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "physics", "area", "nose"),
    [
        ("snooker_12ft.yaml", bs.Physics.snooker(), (3.569, 1.778), 1.4 * 0.02625),  # Mathavan: 7/5 R
        ("carom_10ft.yaml", bs.Physics.carom(), (2.84, 1.42), 0.037),  # UMB
    ],
)
def test_tables_of_other_games_are_as_their_rules_say(name: str, physics: bs.Physics, area: tuple, nose: float) -> None:
    groups = yaml.safe_load((CONFIG / name).read_text())["/**"]["ros__parameters"]
    given = {f"{group}.{key}": value for group in parameters.GROUPS for key, value in groups[group].items()}
    given["scene"] = groups["scene"]
    scene = parameters.read_settings(given).scene
    assert scene.physics == physics
    assert (scene.table.length, scene.table.width) == area
    assert scene.table.nose_height * 2.0 * physics.radius == pytest.approx(nose, abs=1e-5)


def test_what_is_given_wins_over_the_preset_and_the_preset_over_the_scene(tmp_path: Path) -> None:
    given = {"scene": scene_file(tmp_path), "physics.preset": "pool", "physics.ball_restitution": 1}
    assert parameters.read_settings(given).scene.physics == bs.Physics.pool(ball_restitution=1.0)
    given = {"scene": scene_file(tmp_path), "physics.preset": ""}
    assert parameters.read_settings(given).scene.physics == bs.Physics(mass=0.17, sliding_friction=0.25)


def test_a_scene_file_brings_a_preset(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text("physics: snooker\nballs: [{name: cue, position: [0.6, 0.6]}]")
    settings = parameters.read_settings({"scene": str(path), "physics.mass": 0.14})
    assert settings.scene.physics == bs.Physics.snooker(mass=0.14)
    assert settings.values()["physics.preset"] == ""


def test_help_names_every_parameter_with_default_and_unit() -> None:
    text = parameters.help_lines()
    names = [f"{group}.{field}" for group, owner in parameters.GROUPS.items() for field in quantities(owner)]
    for name in ("scene", *parameters.NUMBERS, *parameters.SWITCHES, *parameters.TEXTS, "physics.preset", *names):
        assert f"\n  {name} (" in f"\n{text}"
    for part in (
        "update_rate (100 Hz, ",
        "physics.mass (0.16 kg, >= 1e-06, <= 1e+06): ",
        "physics.rolling_friction (0.01, >= 0, <= 1e+06): ",
    ):
        assert part in text


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
            assert descriptor.additional_constraints.startswith(f"{declared.bounds()}; ")
            assert descriptor.floating_point_range[0].to_value == declared.maximum
            assert descriptor.type == rclpy.Parameter.Type.DOUBLE.value


def test_ros_own_parameters_are_unharmed(make_node: Callable[..., TableNode]) -> None:
    node = make_node("use_sim_time:=true")
    assert node.get_parameter("use_sim_time").value is True
    result = node.set_parameters([rclpy.Parameter("use_sim_time", value=False)])[0]
    assert result.successful, result.reason


def test_a_parameter_of_nobody_is_named(make_node: Callable[..., TableNode]) -> None:
    assert parameters.unknown(make_node("update_rat:=5", "use_sim_time:=false")) == ["update_rat"]


def change(node: TableNode, **changes: object) -> str:
    """Set several parameters in one call, with _ for the dot; returns the reason of a refusal."""
    given = [rclpy.Parameter(name.replace("__", "."), value=value) for name, value in changes.items()]
    result = node.set_parameters_atomically(given)
    assert result.successful is (result.reason == "")
    return result.reason


def test_physics_change_at_rest_and_the_balls_stay(table: TableNode) -> None:
    table.advance(0.5)
    before = table.simulation
    assert change(table, physics__mass=0.17, physics__sliding_friction=0.3) == ""
    after = table.simulation
    assert (after.start_scene.physics.mass, after.start_scene.physics.sliding_friction) == (0.17, 0.3)
    assert np.array_equal(after.positions, before.positions)
    assert (after.time, after.at_rest) == (0.5, True)
    after.strike((85.0, 0.0, 0.0))
    assert after.velocities[0, 0] == pytest.approx(5.0)


def shown_physics(node: TableNode) -> bs.Physics:
    return bs.Physics(**{field: node.get_parameter(f"physics.{field}").value for field in quantities(bs.Physics)})


def test_a_preset_comes_and_goes_at_rest_and_the_balls_stay(table: TableNode) -> None:
    table.advance(0.5)
    before = table.simulation
    assert change(table, physics__mass=0.165) == ""
    assert change(table, physics__preset="pool") == ""
    assert table.simulation.start_scene.physics == shown_physics(table) == bs.Physics.pool(mass=0.165)
    assert table.get_parameter("physics.preset").value == "pool"
    assert np.array_equal(table.simulation.positions, before.positions)
    assert (table.simulation.time, table.simulation.at_rest) == (0.5, True)
    assert change(table, physics__preset="") == ""
    assert table.simulation.start_scene.physics == shown_physics(table) == bs.Physics(mass=0.165)


def test_what_comes_with_a_preset_wins_even_where_it_is_no_change(table: TableNode) -> None:
    assert change(table, physics__preset="pool", physics__ball_restitution=1.0, update_rate=50) == ""
    assert table.simulation.start_scene.physics == shown_physics(table) == bs.Physics.pool(ball_restitution=1.0)
    dump = {name.replace(".", "__"): value for name, value in table.settings.values().items()}
    assert change(table, physics__preset="", physics__ball_restitution=0.5, update_rate=100) == ""
    assert change(table, **dump) == ""
    assert shown_physics(table) == bs.Physics.pool(ball_restitution=1.0)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"physics__preset": "Pool"}, "parameter 'physics.preset' must be one of pool, snooker, carom, got 'Pool'"),
        ({"physics__preset": 3}, "Wrong parameter type"),
        (
            {"physics__preset": "snooker"},
            "parameter 'physics.radius' is fixed while the node runs, at 0.028575 m; physics.preset 'snooker' brings "
            "0.02625: give it at the start, or reset to a scene file that brings it",
        ),
        ({"physics__preset": "pool", "physics__mass": -1.0}, "physics.mass out of range"),
        ({"physics__preset": "pool", "table__nose_height": 0.635}, "'table.nose_height' is fixed while the node runs"),
    ],
)
def test_a_preset_is_refused_together_with_what_comes_with_it(table: TableNode, changes: dict, reason: str) -> None:
    before = (table.settings, table.simulation)
    refused = change(table, physics__gravity=9.8, **changes)
    assert reason in refused
    assert "\n" not in refused
    assert (table.settings, table.simulation) == before
    assert shown_physics(table) == bs.Physics()
    assert table.get_parameter("physics.preset").value == ""


def test_the_radius_that_a_preset_brought_stays_when_it_goes(make_node: Callable[..., TableNode]) -> None:
    node = make_node("physics.preset:=snooker")
    node.start()
    assert shown_physics(node) == bs.Physics.snooker()
    assert "physics.preset '' brings 0.028575" in change(node, physics__preset="")
    assert shown_physics(node) == bs.Physics.snooker()


def test_a_radius_that_is_given_lets_presets_change(make_node: Callable[..., TableNode]) -> None:
    given = make_node("physics.preset:=snooker", "physics.radius:=0.026")
    given.start()
    assert change(given, physics__preset="carom") == ""
    assert shown_physics(given) == bs.Physics.carom(radius=0.026)


def test_a_preset_does_not_disturb_a_scene_that_waits(table: TableNode, tmp_path: Path) -> None:
    path = tmp_path / "one.yaml"
    path.write_text("physics: carom\nballs: [{name: cue, position: [0.6, 0.6]}]")
    assert change(table, scene=str(path)) == ""
    assert change(table, physics__preset="pool") == ""
    assert table.get_parameter("scene").value == str(path)
    assert len(table.simulation.positions) == 16
    table.reset()
    assert shown_physics(table) == table.simulation.start_scene.physics == bs.Physics.pool()
    assert change(table, physics__spin_friction=0.0) == ""
    assert table.simulation.start_scene.physics == bs.Physics.pool(spin_friction=0.0)


def test_no_preset_comes_while_balls_move(table: TableNode) -> None:
    table.simulation.strike((80.0, 0.0, 0.0))
    reason = change(table, physics__preset="pool")
    assert reason == "every ball must rest before a change of physics.preset: ball 'cue' moves at 5 m/s"


def test_an_integer_becomes_a_double(table: TableNode) -> None:
    assert change(table, physics__mass=1, update_rate=50) == ""
    for name, value in (("physics.mass", 1.0), ("update_rate", 50.0)):
        parameter = table.get_parameter(name)
        assert (parameter.type_, parameter.value) == (rclpy.Parameter.Type.DOUBLE, value)
    assert table.settings.update_rate == 50.0


@pytest.mark.parametrize("values", [(50.0, 100.0), (100.0, 50.0), (50.0, 25.0, 100.0)])
def test_of_two_values_of_one_parameter_the_last_holds(table: TableNode, values: tuple) -> None:
    given = [rclpy.Parameter("update_rate", value=value) for value in values]
    assert table.set_parameters_atomically(given).successful
    assert table.get_parameter("update_rate").value == values[-1]
    assert table.settings.update_rate == values[-1]


REFUSED_CHANGES = [
    ({"physics__mass": -1.0}, "physics.mass out of range"),
    ({"physics__mass": 0}, "physics.mass out of range Min: 1e-06, Max: 1000000.0, value: 0.0"),
    ({"physics__mass": float("inf")}, "physics.mass out of range Min: 1e-06, Max: 1000000.0, value: inf"),
    ({"physics__mass": "heavy"}, "Wrong parameter type"),
    ({"physics__rail_restitution": 2}, "physics.rail_restitution out of range"),
    ({"update_rate": 5000}, "update_rate out of range"),
    ({"table__length": 2.54}, "'table.length' is fixed while the node runs, at 2.34 m; got 2.54"),
    ({"physics__radius": 0.03}, "'physics.radius' is fixed while the node runs, at 0.028575 m; got 0.03"),
    ({"scene": "cowboy_pool"}, "'cowboy_pool' is neither a file nor one of head_on"),
    ({"scene": "/nowhere/scene.yaml"}, "'/nowhere/scene.yaml' is neither a file nor one of"),
    ({"use_sim_time": "yes"}, "Wrong parameter type"),
]


@pytest.mark.parametrize(("changes", "reason"), REFUSED_CHANGES)
def test_a_bad_change_is_refused_together_with_what_comes_with_it(table: TableNode, changes: dict, reason: str) -> None:
    before = (table.settings, table.simulation)
    assert reason in change(table, physics__gravity=9.8, **changes)
    assert (table.settings, table.simulation) == before
    assert table.get_parameter("physics.gravity").value == 9.81
    assert change(table, physics__gravity=9.8) == ""


def test_unknown_parameters_are_refused_as_by_any_node(table: TableNode) -> None:
    with pytest.raises(rclpy.exceptions.ParameterNotDeclaredException):
        change(table, physics__mas=1.0)
    assert change(table, use_sim_time=True) == ""
    assert change(table, use_sim_time=False) == ""


def test_nothing_changes_while_balls_move(table: TableNode) -> None:
    table.simulation.strike((80.0, 0.0, 0.0))
    for changes in ({"physics__mass": 0.17}, {"update_rate": 50.0}, {"scene": "head_on"}):
        reason = change(table, **changes)
        name = next(iter(changes)).replace("__", ".")
        assert reason == f"every ball must rest before a change of {name}: ball 'cue' moves at 5 m/s"
    assert change(table, physics__mass=0.16, update_rate=100.0, scene="rack") == ""  # as they are


def test_a_dump_of_all_parameters_can_be_loaded(table: TableNode) -> None:
    values = {name.replace(".", "__"): value for name, value in table.settings.values().items()}
    before = table.settings
    assert change(table, **values) == ""
    assert table.settings is before


def test_a_new_scene_with_its_table_and_balls_waits_for_the_reset(table: TableNode, tmp_path: Path) -> None:
    assert change(table, physics__sliding_friction=0.3) == ""
    assert change(table, scene=scene_file(tmp_path)) == ""
    assert len(table.simulation.positions) == 16
    assert table.get_parameter("table.length").value == 2.34

    assert "two.yaml" in table.reset()
    assert np.array_equal(table.simulation.positions, [[0.5, 0.5], [1.0, 0.5]])
    shown = {name: table.get_parameter(name).value for name in table.settings.values()}
    assert shown == table.settings.values()
    assert (shown["table.length"], shown["physics.mass"]) == (2.54, 0.17)
    assert shown["physics.sliding_friction"] == 0.3  # given, so it holds for every scene
    assert change(table, scene="rack") == ""
    table.reset()
    assert (table.get_parameter("table.length").value, len(table.simulation.positions)) == (2.34, 16)


def test_a_new_scene_with_the_same_table_and_physics_comes_with_the_reset(table: TableNode) -> None:
    assert change(table, scene="head_on") == ""
    assert "scene head_on" in table.reset()
    assert table.get_parameter("scene").value == "head_on"
    assert len(table.simulation.positions) == 2


def test_a_scene_that_waits_keeps_what_is_set_meanwhile(table: TableNode, tmp_path: Path) -> None:
    path = scene_file(tmp_path)
    assert change(table, scene=path) == ""
    assert change(table, physics__mass=0.2, marker_rate=0) == ""
    assert table.simulation.start_scene.physics.mass == 0.2
    Path(path).unlink()  # it was read when it was set
    table.reset()
    assert (table.settings.scene.physics.mass, table.settings.marker_rate) == (0.2, 0.0)
    assert len(table.simulation.positions) == 2


def test_a_new_scene_that_cannot_be_put_on_the_table_changes_nothing(
    table: TableNode, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table.set_parameters([rclpy.Parameter("scene", value=scene_file(tmp_path))])
    before, settings, shown = table.simulation, table.settings, table.get_parameters(list(table.settings.values()))

    def new_simulation(scene: bs.Scene) -> bs.Simulation:
        if len(scene) == 2:
            raise ValueError("too little memory")
        return bs.Simulation(scene)

    monkeypatch.setattr(table_node, "Simulation", new_simulation)
    response = table._on_reset(Trigger.Request(), Trigger.Response())
    assert (response.success, response.message) == (False, "too little memory")
    assert table.simulation is before
    assert table.settings is settings
    assert [one.value for one in table.get_parameters(list(settings.values()))] == [
        str(tmp_path / "two.yaml") if one.name == "scene" else one.value for one in shown
    ]
    monkeypatch.undo()
    assert table._on_reset(Trigger.Request(), Trigger.Response()).success
    assert len(table.simulation.positions) == 2
    assert table.get_parameter("physics.mass").value == 0.17


def test_a_publisher_that_cannot_be_made_is_a_refused_change(make_node: Callable[..., TableNode]) -> None:
    node = make_node("qos_overrides./clock.publisher.depth:=-1")
    node.start()
    given = [rclpy.Parameter("update_rate", value=50.0), rclpy.Parameter("publish_clock", value=True)]
    result = node.set_parameters_atomically(given)
    assert result.successful is False
    assert "depth must be from 0" in result.reason
    assert (node.get_parameter("publish_clock").value, node.settings.publish_clock) == (False, False)
    assert (node.get_parameter("update_rate").value, node.settings.update_rate) == (100.0, 100.0)
    node.advance(0.01)
    assert node.count_publishers("/clock") == 0


def test_an_edited_scene_file_is_read_again_when_it_is_named_again(table: TableNode, tmp_path: Path) -> None:
    path = scene_file(tmp_path)
    assert change(table, scene=path) == ""
    table.reset()
    bs.save_scene(bs.Scene([[0.7, 0.6]]), path)
    table.reset()
    assert len(table.simulation.positions) == 2
    assert change(table, scene=path) == ""
    table.reset()
    assert np.array_equal(table.simulation.positions, [[0.7, 0.6]])
    Path(path).write_text("balls: []")
    assert "balls must be a list of at least one ball" in change(table, scene=path)


def test_a_scene_that_does_not_fit_the_given_table_is_refused(
    make_node: Callable[..., TableNode], tmp_path: Path
) -> None:
    node = make_node("scene:=rack", "table.width:=0.45")
    node.start()
    assert "does not fit these physics and table parameters" in change(node, scene=scene_file(tmp_path))
    assert node.get_parameter("scene").value == "rack"


@pytest.mark.parametrize("group", ["physics", "table"])
def test_a_group_is_no_parameter(group: str) -> None:
    with pytest.raises(ValueError, match=f"no parameter '{group}'; under '{group}' there are "):
        parameters.read_settings({group: 3})


@pytest.mark.parametrize(
    "text",
    [
        "[" * 5000,
        "balls: [{name: cue, position: [1" + "0" * 400 + ", 0.6]}]",
        "physics: {mass: 1" + "0" * 400 + "}\nballs: [{name: cue, position: [0.6, 0.6]}]",
        "no scene at all, but a long text " * 1000,
    ],
    ids=["nested", "huge position", "huge mass", "text"],
)
def test_no_scene_file_ends_the_node(table: TableNode, tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    reason = change(table, scene=str(path))
    assert "parameter 'scene': " in reason
    assert "\n" not in reason
    assert len(reason) <= 500


def test_a_path_that_no_system_takes_is_refused(table: TableNode) -> None:
    assert "parameter 'scene': cannot read" in change(table, scene="x" * 300)


def test_physics_beyond_all_bounds_is_refused(table: TableNode) -> None:
    for name in ("mass", "gravity", "sliding_friction", "rolling_friction", "cue_contact_time"):
        assert change(table, **{f"physics__{name}": 1e308})
        assert np.isfinite(table.describe_parameter(f"physics.{name}").floating_point_range[0].to_value)
