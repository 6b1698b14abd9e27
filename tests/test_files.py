import os
import stat
import threading
from pathlib import Path

import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.files import check_writable, read_text, write_whole


def test_text_is_written_in_utf8_and_bytes_as_they_are(tmp_path: Path) -> None:
    write_whole(tmp_path / "text", "θ = 1°\n")
    write_whole(tmp_path / "bytes", b"\x00\r\n")
    assert (tmp_path / "text").read_bytes() == "θ = 1°\n".encode()
    assert (tmp_path / "bytes").read_bytes() == b"\x00\r\n"


def test_only_the_file_is_left_in_its_folder(tmp_path: Path) -> None:
    for content in ("old", "new"):
        check_writable(tmp_path / "file")
        write_whole(tmp_path / "file", content)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "new"


def test_the_check_alone_leaves_nothing(tmp_path: Path) -> None:
    check_writable(tmp_path / "file")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="POSIX modes")
def test_a_file_keeps_its_mode_and_a_new_one_gets_the_usual(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("old")
    usual = stat.S_IMODE(path.stat().st_mode)
    path.chmod(0o600)
    write_whole(path, "new")
    write_whole(tmp_path / "fresh", "new")
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE((tmp_path / "fresh").stat().st_mode) == usual


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "target")
    write_whole(tmp_path / "link", "content")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == "content"


@pytest.mark.skipif(not Path("/dev/null").is_char_device(), reason="needs /dev/null")
def test_a_device_is_written_to_and_not_replaced() -> None:
    check_writable("/dev/null")
    write_whole("/dev/null", "content")
    assert Path("/dev/null").is_char_device()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes of POSIX")
def test_a_pipe_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    pipe, received = tmp_path / "pipe", list[bytes]()
    os.mkfifo(pipe)
    other_end = threading.Thread(target=lambda: received.append(pipe.read_bytes()), daemon=True)
    other_end.start()
    write_whole(pipe, "content")
    other_end.join(10)
    assert received == [b"content"]
    assert pipe.is_fifo()


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0, reason="the administrator may write everything"
)
def test_a_file_that_may_not_be_written_to_is_not_replaced_either(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("old")
    path.chmod(0o400)
    for attempt in (check_writable, lambda path: write_whole(path, "new")):
        with pytest.raises(BeamstiffError, match="cannot be written: the file is read-only"):
            attempt(path)
    assert path.read_text() == "old"


def test_text_that_is_no_utf8_is_refused_and_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("old")
    with pytest.raises(BeamstiffError, match=r"cannot be written: .*surrogates"):
        write_whole(path, "\udc80")
    assert path.read_text() == "old"


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("missing/file", "there is no folder"),
        ("file/file", "there is no folder"),
        (".", "is a folder"),
        ("x" * 300, "too long"),
        ("a\0b", "null"),
    ],
)
def test_a_path_that_cannot_be_is_refused_by_name(tmp_path: Path, name: str, reason: str) -> None:
    (tmp_path / "file").touch()
    for attempt in (check_writable, lambda path: write_whole(path, "content")):
        with pytest.raises(BeamstiffError, match=f"cannot be written: .*{reason}") as error:
            attempt(tmp_path / name)
        assert str(error.value).isprintable()
    assert [item.name for item in tmp_path.iterdir()] == ["file"]


def test_a_loop_of_links_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(BeamstiffError, match="cannot be written"):
        write_whole(tmp_path / "a", "content")


@pytest.mark.parametrize("moment", ["fsync", "replace"])
@pytest.mark.parametrize("fault", [KeyboardInterrupt, MemoryError, OSError(28, "No space left on device")])
def test_what_goes_wrong_leaves_the_old_file_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: type[BaseException] | BaseException, moment: str
) -> None:
    path = tmp_path / "file"
    path.write_text("old")

    def fail(*_: object) -> None:
        raise fault

    monkeypatch.setattr(os, moment, fail)
    with pytest.raises((KeyboardInterrupt, MemoryError, BeamstiffError)):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["file"]


def test_of_a_missing_file_the_one_of_a_close_name_is_suggested_not_of_a_like_ending(tmp_path: Path) -> None:
    for name in ("taught.mod", "s_trunc.mod", "crane.yaml"):
        (tmp_path / name).write_text("", encoding="utf-8")
    for name, hint in (("nosuch.mod", ""), ("taugt.mod", "taught.mod"), ("crane.yml", "crane.yaml")):
        with pytest.raises(BeamstiffError) as caught:
            read_text(tmp_path / name)
        assert str(caught.value).endswith(f" (did you mean '{hint}'?)" if hint else "no such file")
