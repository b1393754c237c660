# SPDX-License-Identifier: Apache-2.0
"""Scene files: what they say, and that nothing in one costs more than a line."""

from __future__ import annotations

import os
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import billiards_sim as bs
from billiards_sim.engine import scene_file

BALL = "{name: cue, position: [1, 0.5]}"
BALLS = f"balls: [{BALL}]\n"

PARSERS = ["CSafeLoader", "SafeLoader"]


@pytest.fixture(params=PARSERS)
def parser(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Either of PyYAML's parsers, the one in C and the one in Python."""
    if not hasattr(yaml, request.param):
        pytest.skip("PyYAML is here without its C parser")
    if request.param == "SafeLoader":
        monkeypatch.delattr(yaml, "CSafeLoader", raising=False)
    return str(request.param)


def written(tmp_path: Path, text: str | bytes) -> Path:
    path = tmp_path / "scene.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def assert_refused(path: Path, complaint: str, **options: Any) -> None:
    with pytest.raises(ValueError, match=complaint) as refusal:
        bs.load_scene(path, **options)
    assert str(refusal.value).startswith(f"{path}: ")
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 500


def test_file_gives_back_the_same_bits(tmp_path: Path, parser: str) -> None:
    random = np.random.default_rng(3)
    names = [
        "cue",
        "yes",
        "1",
        "ä ö",
        "no: 3",
        "1e3",
        "~",
        ".inf",
        "- #",
        '"',
        "2024-01-01",
        "0x1F",
        "\U0001f3b1",
        "12:30",
    ]
    scene = bs.Scene(
        bs.scenes.random_balls(len(names), seed=2).positions,
        random.uniform(-5, 5, (len(names), 2)) * 10.0 ** random.integers(-30, 1, (len(names), 1)),
        random.uniform(-99, 99, (len(names), 3)),
        names=names,
        table=bs.Table(length=2.5),
        physics=bs.Physics(sliding_friction=0.3, rail_restitution=1.0 / 3.0),
        name="1e3",
        shot=bs.Shot((1.0 / 3.0, 2.0, 0.0), (0.001, -0.002), "yes"),
    )
    bs.save_scene(scene, tmp_path / "scene.yaml")
    loaded = bs.load_scene(tmp_path / "scene.yaml")
    for key in ("positions", "velocities", "angular_velocities"):
        assert np.array_equal(getattr(loaded, key), getattr(scene, key)), key
    for key in ("names", "table", "physics", "name", "shot"):
        assert getattr(loaded, key) == getattr(scene, key), key


def test_file_may_omit_what_has_a_default(tmp_path: Path, parser: str) -> None:
    text = "physics: {sliding_friction: 0.3}\ntable:\nballs:\n  - {name: cue, position: [1, 0.5]}\n"
    scene = bs.load_scene(written(tmp_path, text))
    assert scene.physics == bs.Physics(sliding_friction=0.3)
    assert scene.table == bs.Table()
    assert (scene.shot, scene.name, scene.track_orientation) == (None, "", False)
    assert scene.positions.tolist() == [[1.0, 0.5]]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-1", 0.1),
        ("+.5", 0.5),
        ("5E-1", 0.5),
        ("1.", 1.0),
        ("010", 10.0),
        ("0.1000000000000000055511151231257827", 0.1),
    ],
)
def test_numbers_are_those_of_python(tmp_path: Path, parser: str, text: str, value: float) -> None:
    path = written(tmp_path, BALLS + f"shot: {{force: [{text}, 0, 0]}}")
    shot = bs.load_scene(path).shot
    assert shot is not None
    assert shot.force[0] == value


@pytest.mark.parametrize(
    ("text", "physics"),
    [
        ("pool", bs.Physics.pool()),
        ("{preset: snooker}", bs.Physics.snooker()),
        ("{preset: carom, ball_restitution: 0.9}", bs.Physics.carom(ball_restitution=0.9)),
        ("{ball_restitution: 0.9, preset: pool}", bs.Physics.pool(ball_restitution=0.9)),
        ("{ball_restitution: 0.9}", bs.Physics(ball_restitution=0.9)),
    ],
)
def test_a_file_may_name_a_preset(tmp_path: Path, parser: str, text: str, physics: bs.Physics) -> None:
    scene = bs.load_scene(written(tmp_path, BALLS + f"physics: {text}\ntable: {{nose_height: 0.635}}"))
    assert (scene.physics, scene.table) == (physics, bs.Table(nose_height=0.635))
    path = tmp_path / "saved.yaml"
    bs.save_scene(scene, path)
    assert bs.load_scene(path) == scene
    assert "preset" not in path.read_text()  # its figures are there, whatever the preset will be


def test_file_keeps_whether_orientation_is_tracked(tmp_path: Path, parser: str) -> None:
    path = tmp_path / "scene.yaml"
    for tracked in (True, False):
        bs.save_scene(bs.Scene([[1.0, 0.5]], track_orientation=tracked), path)
        assert bs.load_scene(path).track_orientation is tracked
    assert bs.load_scene(written(tmp_path, BALLS + "track_orientation: yes")).track_orientation is True


@pytest.mark.parametrize(
    "text, complaint",
    [
        ("balls: [", "not YAML"),
        ("\0", "not YAML"),
        ("\t", "not YAML|must be a mapping"),
        (b"\xff\xfe\x00\x81", "utf-8|not YAML"),
        ("", "scene must be a mapping, got None"),
        ("[1, 2]", "scene must be a mapping"),
        ("name: x", "scene lacks balls"),
        ("balls: []", "balls must be a list of at least one ball"),
        ("balls: 3", "balls must be a list of at least one ball, got 3"),
        ("balls: [3]", r"balls\[0\] must be a mapping, got 3"),
        ("balls: [{position: [1, 0.5]}]", r"balls\[0\] lacks name"),
        ("balls: [{name: cue, position: [1, 0.5], spin: 3}]", r"balls\[0\] has no key 'spin'; known: .*velocity"),
        ("balls: [{name: 1, position: [1, 0.5]}]", "ball names must be non-empty strings, got 1"),
        ('balls: [{name: "\\ud800", position: [1, 0.5]}]', "surrogates|not YAML"),
        ('balls: [{name: "a\\nb", position: [1, 0.5]}]', "control characters"),
        (f"balls: [{{name: {1000 * 'a'}, position: [1, 0.5]}}]", "at most 100 characters, got 1000"),
        ("ball: []\nballs: []", "scene has no key 'ball'"),
        (BALLS + "physics: {friction: 1}", "physics has no field 'friction'; known"),
        (BALLS + "table: {length: -1}", "table.length must be a number > 0"),
        (BALLS + "physics: false", "physics must be a mapping of names to numbers or one of the presets pool, .*False"),
        (BALLS + "physics: billiards", "physics.preset must be one of pool, snooker, carom, got 'billiards'"),
        (BALLS + "physics: {preset: Pool}", "physics.preset must be one of pool, snooker, carom, got 'Pool'"),
        (BALLS + "physics: {preset: }", "physics.preset must be one of pool, snooker, carom, got None"),
        (BALLS + "physics: {preset: [pool]}", r"physics.preset must be one of .*, got \['pool'\]"),
        (BALLS + "physics: {preset: pool, mass: -1}", "physics.mass must be a number >= 1e-06.*got -1"),
        (BALLS + "physics: {preset: pool, friction: 1}", "physics has no field 'friction'; known: preset, mass"),
        (BALLS + "table: pool", "table.preset must be one of pool_9ft, .*, got 'pool'"),
        (BALLS + "table: {preset: pool}", "table.preset must be one of pool_9ft, .*, got 'pool'"),
        (BALLS + "table: 0", "table must be a mapping of names to numbers or one of the presets pool_9ft, .*, got 0"),
        (BALLS + "table: []", r"table must be a mapping of names to numbers or one of the presets .*, got \[\]"),
        (BALLS + "name: 3", "name must be a text, got 3"),
        (BALLS + "shot: {force: [1, 0]}", "shot.force must be 3 numbers"),
        (BALLS + "shot: {force: [1, 0, 0], offset: [yes, 0]}", r"shot.offset must be 2 numbers, got \[True, 0\]"),
        (BALLS + "shot: {force: [1, 0, 0], ball: [1]}", "shot.ball .* is not in the scene"),
        (BALLS + "shot: [1]", "shot must be a mapping"),
        (BALLS + "track_orientation: 3", "track_orientation must be a bool, got 3"),
        ("balls: [{name: cue, position: [9, 0.5]}]", "reaches"),
        ("balls: [{name: cue, position: ['1', 0.5]}]", r"balls\[0\].position must be 2 numbers, got \['1', 0.5\]"),
        ("balls: [{name: cue, position: [true, 0.5]}]", r"balls\[0\].position must be 2 numbers, got \[True, 0.5\]"),
        ("balls: [{name: cue, position: [1+0j, 0.5]}]", r"balls\[0\].position must be 2 numbers, got \['1\+0j', 0.5\]"),
        ("balls: [{name: cue, position: [1:30, 0.5]}]", r"balls\[0\].position must be 2 numbers, got"),
        ("balls: [{name: cue, position: [1_0, 0.5]}]", r"balls\[0\].position must be 2 numbers, got"),
        ("balls: [{name: cue, position: 1}]", r"balls\[0\].position must be 2 numbers, got 1"),
        ("balls: [{name: cue, position: [.nan, 0.5]}]", "positions of ball 'cue' must be finite"),
        (f"balls: [{{name: cue, position: [{400 * '9'}, 0.5]}}]", "positions of ball 'cue' must be finite"),
        (f"balls: [{BALL[:-1]}, velocity: [1]}}]", r"balls\[0\].velocity must be 2 numbers"),
        (f"balls: [{BALL[:-1]}, angular_velocity: }}]", r"balls\[0\].angular_velocity must be 3 numbers, got None"),
        ("name: a\nname: b\n" + BALLS, "line 2: the key 'name' comes twice"),
        (BALLS + "\nballs: []", "line 3: the key 'balls' comes twice"),
        ("balls:\n - {name: cue, position: [1, 0.5], name: b}", "line 2: the key 'name' comes twice"),
        (BALLS + "1: 2", "line 2: a key must be a text, got 1"),
        (BALLS + "? [a]\n: 2", "line 2: "),
        (BALLS + "? {a: b}\n: 2", "line 2: "),
        (BALLS + "---\n" + BALLS, "line 2: a second document"),
        ("balls: !!python/object/apply:os.getcwd []", "line 1: a scene has no tags, got '.*os.getcwd'"),
        (BALLS + 'name: !!int ""', "line 2: a scene has no tags, got 'tag:yaml.org,2002:int'"),
        (BALLS + 'name: !!float ""', "line 2: a scene has no tags"),
        (BALLS + 'name: !!bool "xyz"', "line 2: a scene has no tags"),
        (BALLS + 'name: !!timestamp "foo"', "line 2: a scene has no tags"),
        (BALLS + "name: !local x", "line 2: a scene has no tags, got '!local'"),
        (BALLS + "name: ! x", "line 2: a scene has no tags, got '!'"),
        (BALLS + "table: !!map {}", "line 2: a scene has no tags"),
        (BALLS + "table: !!set {length}", "line 2: a scene has no tags"),
        (BALLS + "!!str name: x", "line 2: a scene has no tags"),
        (BALLS + "name: &anchor x", "line 2: a scene has no anchors"),
        (BALLS + "table: &anchor {}", "line 2: a scene has no anchors"),
        ("balls: &all\n- *all", "line 1: a scene has no anchors"),
        (BALLS + "name: *nowhere", "line 2: a scene has no anchors"),
        (BALLS + "table: {<<: {length: 3}}", "table has no field '<<'"),
        (1000 * "[", f"line 1: lists and maps are more than {scene_file.DEEPEST} deep"),
        (1000 * "{a: ", f"line 1: lists and maps are more than {scene_file.DEEPEST} deep"),
        (1000 * "- ", f"line 1: lists and maps are more than {scene_file.DEEPEST} deep"),
        ("\n".join(f"k{index}: 1" for index in range(200)), "line 101: more than 100 keys in a map"),
        (BALLS + "table: {" + 500 * "a" + ": 1}", "table has no field 'aaa"),
    ],
)
def test_bad_file_is_refused_in_one_line_that_names_it(
    tmp_path: Path, parser: str, text: str | bytes, complaint: str
) -> None:
    assert_refused(written(tmp_path, text), complaint)


def test_aliases_of_aliases_cost_nothing(tmp_path: Path, parser: str) -> None:
    levels = "".join(f"a{level}: &a{level} [{', '.join(10 * [f'*a{level - 1}'])}]\n" for level in range(1, 10))
    path = written(tmp_path, "a0: &a0 [1]\n" + levels + "balls: *a9\n")
    tracemalloc.start()
    try:
        assert_refused(path, "line 1: a scene has no anchors")
        assert tracemalloc.get_traced_memory()[1] < 5e6
    finally:
        tracemalloc.stop()


def test_a_file_of_any_size_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "sparse.yaml"
    path.touch()
    os.truncate(path, 10**12)
    assert_refused(path, "1000000000000 bytes are too many for a scene: at most 10000000, for 10000 balls")


def test_the_number_of_balls_is_bounded(tmp_path: Path, parser: str) -> None:
    ball = "  - {{name: b{0}, position: [{1}, 0.5]}}\n"
    text = "table: {length: 3}\nballs:\n" + "".join(ball.format(index, 0.2 + 0.1 * index) for index in range(21))
    assert len(bs.load_scene(written(tmp_path, text), most_balls=21)) == 21
    assert_refused(
        tmp_path / "scene.yaml", "line 23: more than 20 entries in a list; at most 20 balls are taken", most_balls=20
    )
    assert_refused(tmp_path / "scene.yaml", f"{len(text)} bytes are too many .* at most 0, for 0 balls", most_balls=0)


@pytest.mark.parametrize("kind", ["directory", "pipe", "device"])
def test_what_is_no_regular_file_is_not_opened(tmp_path: Path, kind: str) -> None:
    path = {"directory": tmp_path, "pipe": tmp_path / "pipe", "device": Path("/dev/zero")}[kind]
    if kind == "pipe":
        os.mkfifo(path)  # to open it would wait for a writer
    assert_refused(path, "not a regular file")


def test_a_file_that_is_not_there_says_so(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        bs.load_scene(tmp_path / "nowhere.yaml")


def test_a_scene_that_cannot_be_written_leaves_the_file_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "scene.yaml"
    bs.save_scene(bs.scenes.head_on(), path)
    before = path.read_bytes()

    def fail(self: Path, *_: Any, **__: Any) -> None:
        self.write_bytes(b"half a ")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", fail)
    with pytest.raises(OSError, match="No space left"):
        bs.save_scene(bs.scenes.glancing(), path)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["scene.yaml"]
