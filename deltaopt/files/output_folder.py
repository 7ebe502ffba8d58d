"""Output folders: the files that belong together appear in a folder all at once or not at all."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from deltaopt.files.atomic_write import default_mode, require_replaceable, to_disk, write_text
from deltaopt.interrupts.requests import requests_held

try:
    import fcntl
except ImportError:  # Windows, which has other locks; files that are open cannot be replaced there
    fcntl = None  # type: ignore[assignment]

_HIDDEN = ".deltaopt-"
"""Beginning of the names of folders in which files are written before they appear."""
_REPLACED, _LEAVING = ".replaced", ".leaving"
"""In such a folder: what the files replace, and the names of earlier files that leave."""
Earlier = Callable[[Path], Iterable[str]]
"""Gives the names of files in a directory that do not belong beside new ones."""


@contextmanager
def all_or_none(directory: Path, earlier: Earlier = lambda directory: ()) -> Iterator[Path]:
    """Give an empty folder to write files and folders to, which are in ``directory`` at the end.

    The directory is made if need be. Files there that have the same names are replaced; those
    whose names ``earlier`` gives leave; all others stay. If anything is raised in between, the
    directory is left as it was, or not made. Processes that write to the same directory wait for
    each other: it holds the files of one of them.

    Raises OSError, which names the file in ``directory``, if it cannot be written, or must not be
    replaced.
    """
    require_writable(directory)
    with ExitStack() as undo:
        with requests_held():
            hidden = _hidden_folder(directory, undo)
        try:
            yield hidden
            for name in _names(hidden):
                to_disk(hidden / name)
            with requests_held():
                _appear(hidden, directory, earlier)
        except OSError as error:
            raise _named_as_in(directory, error, hidden) from error


def write_texts(directory: Path, texts: Mapping[str, str]) -> list[Path]:
    """Write files with these names and texts into a directory, made if need be: all of them appear
    there at once, or none. Returns their paths. Raises OSError, naming the file."""
    with all_or_none(directory) as folder:
        for name, text in texts.items():
            write_text(folder / name, text)
    return [directory / name for name in texts]


def require_writable(directory: Path) -> None:
    """Raise OSError if a directory cannot be written to, or could not be made."""
    if not directory.is_absolute():
        try:
            Path.cwd()
        except FileNotFoundError:
            problem = "the current directory has been removed"
            raise FileNotFoundError(errno.ENOENT, problem, os.curdir) from None
    nearest = next(each for each in (directory, *directory.parents) if _exists(each))
    if not nearest.is_dir():
        problem = "is a file, not a directory" if nearest.is_file() else "is not a directory"
        raise NotADirectoryError(errno.ENOTDIR, problem, str(nearest))
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, "may not be written to", str(nearest))


def _exists(path: Path) -> bool:
    """Whether there is a file, a directory or a link of any kind, as far as one may see."""
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


def _hidden_folder(directory: Path, undo: ExitStack) -> Path:
    """Make and lock a folder to write in: within the directory if there is one, else beside it."""
    missing = [each for each in directory.parents if not _exists(each)]
    directory.parent.mkdir(parents=True, exist_ok=True)
    for made in missing[::-1]:
        undo.callback(_remove_if_empty, made)
    beside = directory if directory.is_dir() else directory.parent
    while True:
        try:
            hidden = Path(tempfile.mkdtemp(dir=beside, prefix=_HIDDEN))
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(directory)) from error
        undo.callback(shutil.rmtree, hidden, ignore_errors=True)
        undo.enter_context(locked(hidden))
        if hidden.exists():  # else another process took it for abandoned before it was locked
            return hidden


def _named_as_in(directory: Path, error: OSError, hidden: Path) -> OSError:
    """An error with the name of the file in ``directory`` instead of the hidden folder."""
    name = Path(os.fsdecode(error.filename or directory))
    if name.is_relative_to(hidden):
        name = directory / name.relative_to(hidden)
    return OSError(error.errno, error.strerror or str(error), str(name))


def _remove_if_empty(directory: Path) -> None:
    with suppress(OSError):
        directory.rmdir()


def _names(hidden: Path) -> list[Path]:
    """Of the files that are to appear, as seen from the hidden folder."""
    names = (file.relative_to(hidden) for file in sorted(hidden.rglob("*")) if file.is_file())
    return [name for name in names if name.parts[0] not in (_REPLACED, _LEAVING)]


def _appear(hidden: Path, directory: Path, earlier: Earlier) -> None:
    """Move all files into the directory: under its name if it is new, else each under its own."""
    if not directory.is_dir() and _renamed(hidden, directory):
        for left in _abandoned(directory.parent):
            shutil.rmtree(left, ignore_errors=True)
        return
    with locked(directory):
        for left in _abandoned(directory):
            _complete(left, directory)
        _replace(hidden, directory, earlier)


def _renamed(hidden: Path, directory: Path) -> bool:
    try:
        hidden.chmod(default_mode(0o777))
        hidden.rename(directory)
    except OSError:  # another process has made it meanwhile
        return False
    return True


def _replace(hidden: Path, directory: Path, earlier: Earlier) -> None:
    """Move files into a directory; if one cannot be moved, what was replaced or left comes back.

    Old files leave before new ones come: there is never a motion beside the record of another.
    """
    names = _names(hidden)
    leaving = [name for name in map(Path, earlier(directory)) if _exists(directory / name)]
    leaving = [name for name in leaving if name not in names]
    for name in (*names, *leaving):
        require_replaceable(directory / name)
    (hidden / _LEAVING).write_text("\n".join(map(str, leaving)), encoding="utf-8")
    to_disk(hidden / _LEAVING)
    (hidden / _REPLACED).mkdir()
    with ExitStack() as undo:
        for name in names:
            undo.callback(_remove_if_empty, (directory / name).parent)
        for name in (*names, *leaving):
            if _exists(directory / name):
                _move(directory / name, hidden / _REPLACED / name)
                undo.callback((hidden / _REPLACED / name).replace, directory / name)
        for name in names:
            _move(hidden / name, directory / name)
            undo.callback((directory / name).unlink)
        undo.pop_all()
    for name in leaving:
        _remove_if_empty((directory / name).parent)


def _move(file: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    file.rename(target)


def _abandoned(folder: Path) -> Iterator[Path]:
    """Hidden folders, locked, of processes that were killed: nobody else holds their locks."""
    for hidden in folder.glob(f"{_HIDDEN}*") if fcntl else ():
        with suppress(OSError), locked(hidden, wait=False):
            yield hidden


def _complete(hidden: Path, directory: Path) -> None:
    """Remove a hidden folder; if its files were being moved into the directory, all are first."""
    with suppress(OSError):  # it stays for another time
        if (hidden / _REPLACED).is_dir():
            for name in (hidden / _LEAVING).read_text(encoding="utf-8").splitlines():
                if not _exists(hidden / _REPLACED / name):  # else it has left
                    (directory / name).unlink(missing_ok=True)
                _remove_if_empty((directory / name).parent)
            for file in _names(hidden):
                _move(hidden / file, directory / file)
        shutil.rmtree(hidden)


@contextmanager
def locked(folder: Path, *, wait: bool = True) -> Iterator[None]:
    """Hold the lock of a folder, which the system releases when a process ends in any way.

    Raises OSError if ``wait`` is False and another process holds it. Without effect where the
    system or the file system has no such locks.
    """
    if fcntl is None:
        yield
        return
    with ExitStack() as undo:
        with suppress(*((OSError,) if wait else ())):
            opened = os.open(folder, os.O_RDONLY)
            undo.callback(os.close, opened)
            fcntl.flock(opened, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        yield
