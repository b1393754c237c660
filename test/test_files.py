# SPDX-License-Identifier: Apache-2.0
"""Files and directories are written whole or not at all."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from billiards_sim.files import written, written_directory


def test_a_file_appears_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "movie.mp4"
    with written(path) as beside:
        assert beside.suffix == ".mp4"
        assert beside.parent == tmp_path
        beside.write_bytes(b"whole")
        assert not path.exists()
    assert path.read_bytes() == b"whole"
    assert os.listdir(tmp_path) == ["movie.mp4"]


@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize("reason", [OSError(28, "full"), KeyboardInterrupt()])
def test_what_fails_or_is_interrupted_leaves_nothing(tmp_path: Path, there: bool, reason: BaseException) -> None:
    path = tmp_path / "movie.mp4"
    if there:
        path.write_bytes(b"before")
    with pytest.raises(type(reason)), written(path) as beside:
        beside.write_bytes(b"half")
        raise reason
    assert os.listdir(tmp_path) == (["movie.mp4"] if there else [])
    if there:
        assert path.read_bytes() == b"before"


def test_a_new_file_has_the_mode_of_any_other_and_an_old_one_keeps_its_own(tmp_path: Path) -> None:
    new, plain, old = tmp_path / "new", tmp_path / "plain", tmp_path / "old"
    plain.touch()
    old.touch()
    old.chmod(0o640)
    for path in (new, old):
        with written(path) as beside:
            beside.write_bytes(b"x")
    assert stat.S_IMODE(new.stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)
    assert stat.S_IMODE(old.stat().st_mode) == 0o640


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    target, link = tmp_path / "there" / "a.json", tmp_path / "b.json"
    link.symlink_to(target)
    with written(link) as beside:
        beside.write_bytes(b"x")
    assert link.is_symlink()
    assert target.read_bytes() == b"x"


def test_a_device_is_written_to(tmp_path: Path) -> None:
    with written("/dev/null") as path:
        assert path == Path("/dev/null")
        path.write_bytes(b"x")


def test_a_place_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = tmp_path / "nowhere" / "a.json"
    with pytest.raises(FileNotFoundError) as refusal, written(path):
        pytest.fail("began to write")
    assert refusal.value.filename == str(path)


def test_a_directory_appears_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "bag"
    with written_directory(path) as beside:
        assert beside.parent == tmp_path
        (beside / "file").write_bytes(b"whole")
        assert not path.exists()
    assert os.listdir(tmp_path) == ["bag"]
    assert (path / "file").read_bytes() == b"whole"


@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize("reason", [OSError(28, "full"), KeyboardInterrupt()])
def test_of_a_directory_that_fails_or_is_interrupted_nothing_is_left(
    tmp_path: Path, there: bool, reason: BaseException
) -> None:
    path = tmp_path / "bag"
    if there:
        path.mkdir()
    with pytest.raises(type(reason)), written_directory(path) as beside:
        (beside / "file").write_bytes(b"half")
        raise reason
    assert os.listdir(tmp_path) == (["bag"] if there else [])
    if there:
        assert os.listdir(path) == []


def test_a_directory_takes_the_place_of_an_empty_one_alone(tmp_path: Path) -> None:
    for name in ("empty", "full"):
        (tmp_path / name).mkdir()
    (tmp_path / "full" / "mine").touch()
    with written_directory(tmp_path / "empty") as beside:
        (beside / "file").touch()
    assert os.listdir(tmp_path / "empty") == ["file"]
    with pytest.raises(OSError), written_directory(tmp_path / "full") as beside:
        (beside / "file").touch()
    assert os.listdir(tmp_path / "full") == ["mine"]
    assert sorted(os.listdir(tmp_path)) == ["empty", "full"]


def test_a_place_for_a_directory_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = tmp_path / "nowhere" / "bag"
    with pytest.raises(FileNotFoundError) as refusal, written_directory(path):
        pytest.fail("began to write")
    assert refusal.value.filename == str(path)
