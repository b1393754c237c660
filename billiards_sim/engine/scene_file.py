# SPDX-License-Identifier: Apache-2.0
"""Scenes as YAML files: plain texts, numbers, lists and maps.

A file may come from anybody, so it is read event by event, and what no scene has is refused where it stands, before
anything is built: tags, anchors and aliases, keys that come twice, more depth, keys or entries than a scene can have.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from billiards_sim.engine.physics import PRESETS as PHYSICS_PRESETS
from billiards_sim.engine.physics import Physics
from billiards_sim.engine.quantity import from_mapping, numbers, shown
from billiards_sim.engine.scene import Scene, Shot
from billiards_sim.engine.table import PRESETS as TABLE_PRESETS
from billiards_sim.engine.table import Table
from billiards_sim.files import written

MOST_BALLS = 10_000
"""In a file: some seconds of reading, for a table that is full of them."""

BYTES_PER_BALL = 1000
"""Of a file. `save_scene` writes a quarter of it; the rest is for comments."""

MOST_KEYS = 100
"""Of a map."""

DEEPEST = 6
"""Lists and maps in each other: a scene has balls, each a map with a position."""

NUMBER = re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?")
WHOLE = re.compile(r"[-+]?[0-9]{1,15}")
WORDS: dict[str, Any] = {
    **dict.fromkeys(("", "~", "null"), None),
    **dict.fromkeys(("true", "yes", "on"), True),
    **dict.fromkeys(("false", "no", "off"), False),
    **{".nan": float("nan"), ".inf": float("inf"), "+.inf": float("inf"), "-.inf": -float("inf")},
}
"""What words without quotes stand for, in small letters. Everything else that is no number is a text."""


VALUES = ("ScalarEvent", "SequenceStartEvent", "MappingStartEvent", "AliasEvent")
"""PyYAML's events that begin a value. By name, as PyYAML is imported only where a file is read."""


def load_scene(path: str | Path, most_balls: int = MOST_BALLS) -> Scene:
    """Read a scene from a YAML file.

    Args:
        most_balls: of a scene that is taken; bounds the size of the file, too.

    Raises:
        ValueError: no regular file, too large, not YAML, more than a scene can have, or a scene that `Scene` refuses;
            one line that starts with the path.
        OSError: the file cannot be read.
        ImportError: PyYAML is not installed.
    """
    _yaml()
    try:
        return read_scene(_text(Path(path), most_balls), most_balls)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def read_scene(text: str, most_balls: int = MOST_BALLS) -> Scene:
    """Read a scene from the text of a scene file.

    Raises:
        ValueError: as `load_scene`, without the path.
        ImportError: PyYAML is not installed.
    """
    yaml = _yaml()
    try:
        # That of C, where PyYAML has it, is 20 times as fast. They differ in a few odd tabs and colons.
        events = yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
        return _scene(_document(events, most_balls))
    except yaml.YAMLError as error:
        raise ValueError(f"not YAML: {' '.join(str(error).split())}") from None


def save_scene(scene: Scene, path: str | Path) -> None:
    """Write a scene as YAML; `load_scene` gives back the same numbers to the last bit.

    Raises:
        OSError: the file cannot be written.
        ImportError: PyYAML is not installed.
    """
    text = scene_text(scene)
    with written(path) as file:
        file.write_text(text, encoding="utf-8")


def scene_text(scene: Scene) -> str:
    """What `save_scene` writes.

    Raises:
        ImportError: PyYAML is not installed.
    """
    yaml = _yaml()
    document: dict[str, Any] = {
        "name": _Quoted(scene.name),
        "table": dataclasses.asdict(scene.table),
        "physics": dataclasses.asdict(scene.physics),
        "balls": [
            {"name": _Quoted(name), "position": p.tolist(), "velocity": v.tolist(), "angular_velocity": w.tolist()}
            if in_play
            else {"name": _Quoted(name), "in_play": False}
            for name, p, v, w, in_play in zip(
                scene.names, scene.positions, scene.velocities, scene.angular_velocities, scene.in_play, strict=True
            )
        ],
    }
    if scene.shot is not None:
        shot = scene.shot
        document["shot"] = {"ball": _Quoted(shot.ball), "force": list(shot.force), "offset": list(shot.offset)}
    if scene.track_orientation:
        document["track_orientation"] = True

    class Dumper(yaml.SafeDumper):  # type: ignore[misc, name-defined]
        pass

    Dumper.add_representer(
        _Quoted, lambda dumper, text: dumper.represent_scalar("tag:yaml.org,2002:str", str(text), style='"')
    )
    text: str = yaml.dump(document, Dumper=Dumper, sort_keys=False, default_flow_style=None, allow_unicode=True)
    return text


class _Quoted(str):
    """A text that stands in quotes, so that nobody takes it for a number or a truth value."""


def _yaml() -> Any:
    try:
        import yaml
    except ImportError:
        raise ImportError("scene files need PyYAML: pip install pyyaml") from None
    return yaml


def _text(path: Path, most_balls: int) -> str:
    if path.exists() and not path.is_file():
        raise ValueError("not a regular file")
    most = BYTES_PER_BALL * most_balls
    size = path.stat().st_size
    if size > most:
        raise ValueError(f"{size} bytes are too many for a scene: at most {most}, for {most_balls} balls")
    with path.open("rb") as file:
        return file.read(size).decode("utf-8")


def _document(events: Iterator[Any], most_balls: int) -> Any:
    # The one document of a stream.
    value = None
    documents = 0
    for event in events:
        kind = type(event).__name__
        if kind == "DocumentStartEvent":
            documents += 1
            if documents > 1:
                raise ValueError(f"{_place(event)}: a second document; a scene is one")
        elif kind in VALUES:
            value = _value(events, event, most_balls, 1)
    return value


def _value(events: Iterator[Any], event: Any, most: int, depth: int) -> Any:
    kind = type(event).__name__
    if kind == "AliasEvent" or event.anchor is not None:
        raise ValueError(f"{_place(event)}: a scene has no anchors (&) and no aliases (*)")
    if event.tag is not None:
        raise ValueError(f"{_place(event)}: a scene has no tags, got {shown(event.tag)}")
    if kind == "ScalarEvent":
        return _plain(event.value) if event.implicit[0] else event.value
    if depth > DEEPEST:
        raise ValueError(f"{_place(event)}: lists and maps are more than {DEEPEST} deep in each other")
    if kind == "SequenceStartEvent":
        return _list(events, event, most, depth)
    return _map(events, event, most, depth)


def _list(events: Iterator[Any], start: Any, most: int, depth: int) -> list[Any]:
    values: list[Any] = []
    for event in events:
        if type(event).__name__ == "SequenceEndEvent":
            break
        if len(values) == most:
            raise ValueError(f"{_place(event)}: more than {most} entries in a list; at most {most} balls are taken")
        values.append(_value(events, event, most, depth + 1))
    return values


def _map(events: Iterator[Any], start: Any, most: int, depth: int) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for event in events:
        if type(event).__name__ == "MappingEndEvent":
            break
        key = _value(events, event, most, DEEPEST + 1)
        if not isinstance(key, str):
            raise ValueError(f"{_place(event)}: a key must be a text, got {shown(key)}")
        if key in values:
            raise ValueError(f"{_place(event)}: the key {shown(key)} comes twice")
        if len(values) == MOST_KEYS:
            raise ValueError(f"{_place(event)}: more than {MOST_KEYS} keys in a map")
        values[key] = _value(events, next(events), most, depth + 1)
    return values


def _place(event: Any) -> str:
    return f"line {event.start_mark.line + 1}"


def _plain(text: str) -> Any:
    # What a scalar without quotes stands for.
    if text.lower() in WORDS:
        return WORDS[text.lower()]
    if NUMBER.fullmatch(text):
        return int(text) if WHOLE.fullmatch(text) else float(text)
    return text


def _scene(document: Any) -> Scene:
    _check_keys(
        "scene", document, required={"balls"}, optional={"name", "table", "physics", "shot", "track_orientation"}
    )
    balls = document["balls"]
    if not isinstance(balls, list) or not balls:
        raise ValueError(f"balls must be a list of at least one ball, got {shown(balls)}")
    for index, ball in enumerate(balls):
        if isinstance(ball, dict) and ball.get("in_play") is False:
            _check_keys(f"balls[{index}], which is not in play,", ball, {"name", "in_play"}, set())
        else:
            _check_keys(f"balls[{index}]", ball, {"name", "position"}, {"velocity", "angular_velocity", "in_play"})
    name = document.get("name")
    if not isinstance(name, (str, type(None))):
        raise ValueError(f"name must be a text, got {shown(name)}")
    shot = document.get("shot")
    if shot is not None:
        _check_keys("shot", shot, required={"force"}, optional={"ball", "offset"})
    return Scene(
        positions=_column(balls, "position", 2),
        velocities=_column(balls, "velocity", 2),
        angular_velocities=_column(balls, "angular_velocity", 3),
        names=[ball["name"] for ball in balls],
        in_play=[ball.get("in_play", True) for ball in balls],
        table=from_mapping(Table, _group(document, "table"), TABLE_PRESETS),
        physics=from_mapping(Physics, _group(document, "physics"), PHYSICS_PRESETS),
        name=name or "",
        shot=None if shot is None else Shot(**shot),
        track_orientation=document.get("track_orientation", False),
    )


def _column(balls: list[dict[str, Any]], key: str, width: int) -> list[tuple[float, ...]]:
    zero = (0.0,) * width
    return [numbers(f"balls[{index}].{key}", ball.get(key, zero), width) for index, ball in enumerate(balls)]


def _group(document: dict[str, Any], key: str) -> Any:
    # A key with nothing behind it gives the defaults.
    values = document.get(key)
    return {} if values is None else values


def _check_keys(where: str, mapping: Any, required: set[str], optional: set[str]) -> None:
    if not isinstance(mapping, dict):
        raise ValueError(f"{where} must be a mapping, got {shown(mapping)}")
    missing = required - mapping.keys()
    unknown = [key for key in mapping if key not in required | optional]
    if missing:
        raise ValueError(f"{where} lacks {', '.join(sorted(missing))}")
    if unknown:
        known = ", ".join(sorted(required | optional))
        raise ValueError(f"{where} has no key {shown(unknown[0])}; known: {known}")
