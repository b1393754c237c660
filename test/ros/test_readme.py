"""The README says what the program declares."""

from __future__ import annotations

from pathlib import Path

import pytest

from billiards_sim.engine.quantity import quantities
from billiards_sim.ros import parameters

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def rows() -> list[str]:
    rows = [f"| `scene` | `{parameters.DEFAULT_SCENE}` | | | {parameters.SCENE_HELP} |"]
    rows += [f"| `{name}` | {str(on).lower()} | | | {text} |" for name, (on, text) in parameters.SWITCHES.items()]
    declared = [(name, default, quantity) for name, (default, quantity) in parameters.NUMBERS.items()]
    for group, owner in parameters.GROUPS.items():
        for field, quantity in quantities(owner).items():
            declared.append((f"{group}.{field}", getattr(owner(), field), quantity))
    return rows + [f"| `{name}` | {value:g} | {q.unit} | {q.bounds()} | {q.help} |" for name, value, q in declared]


@pytest.mark.parametrize("row", rows())
def test_parameter_table_is_the_declarations(row: str) -> None:
    assert row in README


def test_every_topic_of_the_node_is_listed() -> None:
    for topic in (
        "cue_shot",
        "balls/poses",
        "balls/twists",
        "markers",
        "table_markers",
        "collisions",
        "shot_result",
        "place_balls",
        "placement_result",
        "cue_shot/preview",
        "preview",
        "preview/result",
        "~/pause",
        "~/step",
    ):
        assert f"`{topic}`" in README
