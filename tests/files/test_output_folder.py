"""Output folders: all files at once or none, whatever happens in between."""

from __future__ import annotations

import errno
import os
import resource
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from deltaopt.files.atomic_write import atomic_write
from deltaopt.files.output_folder import all_or_none, require_writable, write_texts
from deltaopt.files.yaml_file import write_yaml

NEW = {"a.csv": "new a", "b.json": "new b"}
OLD = {"a.csv": "old a", "b.json": "old b", "notes.txt": "mine"}
EARLIER = {"deep/c.csv": "old c"}


def write(folder: Path, texts: dict[str, str]) -> None:
    for name, text in texts.items():
        if "/" in name:
            (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def content(folder: Path) -> dict[str, str]:
    """The text of each file; hidden ones too."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_text(encoding="utf-8") for path in files}


@pytest.fixture
def old(tmp_path) -> Path:
    folder = tmp_path / "old"
    folder.mkdir()
    write(folder, OLD)
    return folder


def test_a_new_folder_has_all_files_at_once(tmp_path):
    folder = tmp_path / "deep" / "new"
    with all_or_none(folder) as hidden:
        write(hidden, NEW)
        assert not folder.exists()
    assert content(folder) == NEW
    assert os.listdir(tmp_path / "deep") == ["new"]
    plain = tmp_path / "plain"
    plain.mkdir()
    assert folder.stat().st_mode == plain.stat().st_mode


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.ENOSPC, "full")])
def test_after_an_error_all_is_as_it_was(error, old, tmp_path):
    def failing(hidden: Path) -> None:
        write(hidden, NEW)
        raise error

    for folder in (old, tmp_path / "deep" / "new"):
        with pytest.raises(type(error)), all_or_none(folder) as hidden:
            failing(hidden)
    assert content(old) == OLD
    assert os.listdir(tmp_path) == ["old"]


def test_a_file_that_cannot_be_moved_brings_back_the_others(old, monkeypatch):
    rename = Path.rename

    def failing(self, target):
        if Path(target) == old / "b.json":
            raise PermissionError(errno.EACCES, "it is open", str(self))
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", failing)
    write(old, EARLIER)
    with pytest.raises(PermissionError) as told, all_or_none(old, lambda _: EARLIER) as hidden:
        write(hidden, {"a/new.csv": "new", **NEW})
    assert told.value.filename == str(old / "b.json")
    assert content(old) == {**OLD, **EARLIER}
    assert not (old / "a").exists()


@pytest.mark.parametrize("others", [{}, {"deep/notes.txt": "mine"}])
def test_earlier_files_leave_unless_they_are_replaced(others, old):
    """And a folder that is empty then; what is no file of these names stays."""
    write(old, EARLIER | others)
    names = [*EARLIER, "a.csv", "other", "nowhere/at.all"]
    with all_or_none(old, lambda _: names) as hidden:
        write(hidden, {"a.csv": "new a", "2/d.csv": "new d"})
    assert content(old) == {**OLD, "a.csv": "new a", "2/d.csv": "new d", **others}
    assert (old / "deep").exists() == bool(others)


def test_a_folder_that_is_removed_meanwhile_is_named(tmp_path):
    folder = tmp_path / "gone"
    folder.mkdir()

    def removed(hidden: Path) -> None:
        hidden.rmdir()
        folder.rmdir()
        write(hidden, NEW)

    with pytest.raises(FileNotFoundError) as told, all_or_none(folder) as hidden:
        removed(hidden)
    assert told.value.filename == str(folder / "a.csv")
    assert os.listdir(tmp_path) == []


KILLED = """
import os, signal, sys
from pathlib import Path
from deltaopt.files.output_folder import all_or_none
folder, moves = Path(sys.argv[1]), int(sys.argv[2])
rename = Path.rename
def last(self, target):
    global moves
    moves -= 1
    if moves < 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return rename(self, target)
Path.rename = last
with all_or_none(folder, lambda _: ["deep/c.csv"]) as hidden:
    for name in ("a.csv", "b.json"):
        (hidden / name).write_text("new " + name[0])
"""


@pytest.mark.parametrize("moves", range(5))
def test_what_a_killed_process_had_begun_to_move_is_completed(moves, old):
    """Killed between the moves of its files: old ones never stand beside new ones, and the next to
    write there, whatever it writes, brings what is missing."""
    write(old, EARLIER)
    run = subprocess.run([sys.executable, "-c", KILLED, str(old), str(moves)])
    assert run.returncode == -signal.SIGKILL
    names = (*NEW, *EARLIER)
    between = {name: (old / name).read_text() for name in names if (old / name).exists()}
    assert between.items() <= NEW.items() or between.items() <= (OLD | EARLIER).items()
    with all_or_none(old) as hidden:
        write(hidden, {"other": "other"})
    assert content(old) == {**NEW, "notes.txt": "mine", "other": "other"}


def test_of_many_that_write_at_once_one_has_the_folder(tmp_path):
    """In threads, some of which make the folder and some of which find it."""

    def own(k: int) -> None:
        for _ in range(10):
            with all_or_none(tmp_path / "shared") as hidden:
                write(hidden, dict.fromkeys(NEW, f"{k}"))

    threads = [threading.Thread(target=own, args=(k,)) for k in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(content(tmp_path / "shared").values())) == 1
    assert sorted(content(tmp_path / "shared")) == sorted(NEW)
    assert os.listdir(tmp_path) == ["shared"]


def test_ctrl_c_while_files_move_waits(old, monkeypatch):
    rename = Path.rename

    def interrupting(self, target):
        signal.raise_signal(signal.SIGINT)
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", interrupting)
    with pytest.raises(KeyboardInterrupt), all_or_none(old) as hidden:
        write(hidden, NEW)
    assert content(old) == {**NEW, "notes.txt": "mine"}


@pytest.fixture
def full_disk():
    """No file may grow beyond 4 kB: errors as of a full disk, for root too."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    usual = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    signal.signal(signal.SIGXFSZ, usual)


@pytest.mark.usefixtures("full_disk")
def test_a_full_disk_names_the_file(old):
    def filling(hidden: Path) -> None:
        write(hidden, {"a.csv": "new a"})
        with atomic_write(hidden / "b.json") as file:
            file.write_text("x" * 5000, encoding="utf-8")

    with pytest.raises(OSError, match="too large") as told, all_or_none(old) as hidden:
        filling(hidden)
    assert told.value.filename == str(old / "b.json")
    assert content(old) == OLD


@pytest.mark.usefixtures("full_disk")
def test_a_full_disk_names_the_text_that_does_not_fit(old):
    with pytest.raises(OSError, match="too large") as told:
        write_texts(old, {"a.csv": "new a", "b.json": "x" * 5000})
    assert told.value.filename == str(old / "b.json")
    with pytest.raises(OSError, match="too large") as told:
        write_yaml(old / "b.json", {"name": "x" * 5000})
    assert told.value.filename == str(old / "b.json")
    assert content(old) == OLD


# Where one may write, said before any work


def test_a_file_that_is_write_protected_stays(old):
    protected = old / "a.csv"
    protected.chmod(0o444)
    if os.access(protected, os.W_OK):
        pytest.skip("who runs this may write to every file")
    with pytest.raises(PermissionError, match="write-protected"), all_or_none(old) as hidden:
        write(hidden, NEW)
    assert content(old) == OLD


def test_what_is_no_directory(tmp_path, monkeypatch):
    file, loop = tmp_path / "file", tmp_path / "loop"
    file.touch()
    loop.symlink_to(loop)
    with pytest.raises(NotADirectoryError, match="is a file"):
        require_writable(file / "deeper" / "still")
    with pytest.raises(NotADirectoryError, match="is not a directory"):
        require_writable(loop)
    with pytest.raises(OSError, match="symbolic links"):
        require_writable(loop / "deeper")
    require_writable(tmp_path / "new" / "folder")
    assert sorted(os.listdir(tmp_path)) == ["file", "loop"]
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    require_writable(Path("out"))
    gone.rmdir()
    with pytest.raises(FileNotFoundError, match="current directory has been removed"):
        require_writable(Path("out"))
