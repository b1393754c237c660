# SPDX-License-Identifier: Apache-2.0
"""What message types are made of, as text: for files that are read where their packages are not.

ROS packages bring a `.msg` file for each type and, since the distribution Iron, a `.json` that names the types in it
and its hash (REP 2011, REP 2016).
"""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any, NamedTuple

from billiards_sim.ros.transforms import TF_TYPE

FRAMES_TYPE = "geometry_msgs/msg/TransformStamped"
FRAMES_TEXT = "geometry_msgs/TransformStamped[] transforms\n"
FRAMES_HASH = "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
"""What `TF_TYPE` is, whose package need not be installed."""

RULE = "=" * 80


class Definition(NamedTuple):
    """Of a type.

    Attributes:
        name: as `std_msgs/msg/Bool`.
        text: in the form `ros2msg`: its `.msg` file, and behind it those of all types that are in it.
        digest: its hash.
    """

    name: str
    text: str
    digest: str


def type_name(message: Any) -> str:
    """The name of a message class, as `std_msgs/msg/Bool`."""
    return f"{message.__module__.partition('.')[0]}/msg/{message.__name__}"


def definition_of(name: str) -> Definition:
    """Of a type, by its name.

    Raises:
        ValueError: its package is not installed, or brings no definitions.
    """
    if name == TF_TYPE:
        inner = definition_of(FRAMES_TYPE)
        return Definition(name, FRAMES_TEXT + _heading(FRAMES_TYPE) + inner.text, FRAMES_HASH)
    described = json.loads(_read(name, "json"))
    others = [one["type_name"] for one in described["type_description_msg"]["referenced_type_descriptions"]]
    hashes = {one["type_name"]: one["hash_string"] for one in described["type_hashes"]}
    text = _read(name, "msg") + "".join(_heading(other) + _read(other, "msg") for other in others)
    return Definition(name, text, hashes[name])


def _heading(name: str) -> str:
    return f"{RULE}\nMSG: {name.replace('/msg/', '/')}\n"


def _read(name: str, ending: str) -> str:
    package, _, short = name.split("/")
    found = importlib.util.find_spec(package)
    for prefix in Path(found.origin).parents if found is not None and found.origin is not None else ():
        file = prefix / "share" / package / "msg" / f"{short}.{ending}"
        if file.is_file():
            return file.read_text(encoding="utf-8").rstrip("\n") + "\n"
    raise ValueError(f"the ROS package {package} brings no {short}.{ending} that defines {name}")
