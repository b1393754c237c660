# SPDX-License-Identifier: Apache-2.0
"""How executables take a scene: by the name of one that is built in, or as a file."""

from __future__ import annotations

from pathlib import Path

from billiards_sim.command_line import Refusal
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.scene_file import load_scene
from billiards_sim.engine.scenes import BUILT_IN

SCENE_HELP = f"a scene file, or one of {', '.join(BUILT_IN)}"


def scene_named(name: str) -> Scene:
    """The scene that SCENE on a command line means.

    Raises:
        Refusal: it is neither a file nor the name of one, or the file cannot be read, or is wrong.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]()
    try:
        if not Path(name).exists():
            raise Refusal(f"SCENE {name!r} is neither a file nor one of {', '.join(BUILT_IN)}")
        return load_scene(name)
    except ImportError:
        raise Refusal(f"scene file {name!r} needs PyYAML: pip install pyyaml, or 'billiards_sim[ros]'") from None
    except OSError as error:
        raise Refusal(f"cannot read {name!r}: {error.strerror or error}") from None
    except ValueError as error:
        raise Refusal(error) from None
