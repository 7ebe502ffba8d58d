"""Kinds of attempts: words of the command line, what is no file, signals, what check says."""

from __future__ import annotations

import argparse
import os
import re
import signal
import socket
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

import deltaopt.cli
from deltaopt.codegen.compile import CACHE, cache_directory
from deltaopt.files.yaml_file import write_yaml
from studies.attack.attempts import Attempt, Generator, Kind, command
from studies.attack.scene_files import SCENE, Content, at, drawn, places, replaced, written
from studies.interrupts import NOTES, contents, faults_of_files, left_behind, run_until
from studies.problems import ORSINO, PICK_AND_PLACE

_ODD = (
    "nan",
    "inf",
    "-inf",
    "-1",
    "",
    "abc",
    "1e999",
    "0x10",
    "--",
    "1,5",
    "1e-400",
    "2.5.1",
    "1 m",
)
_FILES = {"SCENE": PICK_AND_PLACE, "ROBOT": ORSINO, "PLAN": "plan", "FILE": PICK_AND_PLACE}


def _options(
    parser: argparse.ArgumentParser, words: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], argparse.Action, list[str]]]:
    """Options that take a number or a choice: the command's words, the option, and the files that
    the command needs."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, inner in action.choices.items():
                yield from _options(inner, (*words, name))
        elif action.option_strings and (action.choices or action.type not in (None, Path)):
            needed = [each for each in parser._actions if not each.option_strings]
            names = [str(each.metavar).split("|")[0] for each in needed]
            yield words, action, [str(_FILES.get(name, name)) for name in names]


def options(rng: Generator) -> Attempt:
    """An option with a value that is none."""
    found = [
        each
        for each in _options(deltaopt.cli.command_line())
        if each[1].dest not in ("output", "directory")
    ]
    words, action, files = found[rng.integers(len(found))]
    option, odd = action.option_strings[-1], str(rng.choice(_ODD))
    given = [*words, *files, option, odd]
    return Attempt(" ".join(map(repr, given)), lambda: command(*given).unclear(option))


def _linked(path: Path, target: Path) -> None:
    path.symlink_to(target)


def _listening(path: Path) -> None:
    socket.socket(socket.AF_UNIX).bind(str(path))


_THINGS: dict[str, Callable[[Path], object]] = {
    "nothing": lambda path: None,
    "folder": lambda path: path.mkdir(),
    "pipe": lambda path: os.mkfifo(path),
    "socket": _listening,
    "zero": lambda path: _linked(path, Path("/dev/zero")),
    "itself": lambda path: _linked(path, path),
    "dangling": lambda path: _linked(path, Path("nowhere")),
    "text of the system": lambda path: _linked(path, Path("/etc/passwd")),
    "program": lambda path: _linked(path, Path(sys.executable)),
    "processes": lambda path: _linked(path, Path("/proc/self/mem")),
    "empty": lambda path: path.write_bytes(b""),
    "zeros": lambda path: path.write_bytes(bytes(1000)),
    "large": lambda path: path.write_bytes(b"a, 1\n" * 1_000_000),
}
_NAMES = ("it.yaml", "it.csv", "it.stl", "-it", "i t\n.yaml", "\u202eit", "it\x1b[31m")
_PLACES = ("check", "plan", "robot", "hull", "path", "table", "table robot", "saved", "export", "c")


def inputs(rng: Generator) -> Attempt:
    """What is no such file, wherever one is read."""
    thing, name, place = (str(rng.choice(each)) for each in (list(_THINGS), _NAMES, _PLACES))

    def made() -> str:
        path = Path(name)
        _THINGS[thing](path)
        robot, scene = drawn(rng, [PICK_AND_PLACE])[1:]
        keys: dict[str, Content] = {"robot": {"robot": name}}
        keys["hull"] = {"keep_out": [{"hull": {"file": name}}]}
        keys["path"] = {"path": {"points": name, "blend": 0.01}}
        written(robot, scene)
        write_yaml(SCENE, scene | keys.get(place, {}))
        Path("t.csv").write_text("t,x,y,z\n0,0,0,0\n")
        words: dict[str, list[object]] = {
            "check": ["check", "--", name],
            "plan": ["plan", "--", name],
            "table": ["verify", "--robot", ORSINO, "--", name],
            "table robot": ["verify", "t.csv", f"--robot={name}"],
            "saved": ["verify", "--", name],
            "export": ["export", "table", "--", name],
            "c": ["export", "c", "--", name],
        }
        ended = command(*words.get(place, ["check", SCENE]))
        leaked = "root:" in ended.errors or "\x1b" in ended.errors
        return "what is in the file is quoted" if leaked else ended.unclear()

    return Attempt(f"{thing} named {name!r} as {place}", made)


_TARGETS: dict[str, Callable[[Path], object]] = {
    "device": lambda path: os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, 3)),
    "full": lambda path: os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, 7)),
    "pipe": lambda path: os.mkfifo(path),
    "link to a file": lambda path: _linked(path, Path(NOTES)),
    "link to a folder": lambda path: _linked(path, Path("folder")),
    "dangling": lambda path: _linked(path, Path("nowhere")),
    "itself": lambda path: _linked(path, path),
    "file": lambda path: path.write_text("mine", encoding="utf-8"),
    "folder": lambda path: path.mkdir(),
    "nothing": lambda path: None,
}
_WRITERS: dict[str, tuple[object, ...]] = {
    "plan": ("plan", PICK_AND_PLACE, "--baseline", "--no-plot"),
    "inverse": ("inverse", PICK_AND_PLACE),
    "table": ("export", "table", "plan"),
    "cam": ("export", "cam", "plan"),
    "ros2": ("export", "ros2", "plan"),
    "c": ("export", "c", ORSINO),
    "mjcf": ("export", "mjcf", ORSINO),
    "schema": ("export", "schema"),
}


def outputs(rng: Generator) -> Attempt:
    """An output that is a device, a pipe, a link or somebody's file, which stay what they are."""
    target, writer = str(rng.choice(list(_TARGETS))), str(rng.choice(list(_WRITERS)))
    name = str(rng.choice(["out", "out.yaml", "out/deep/er", "o" * 300]))

    def made() -> str:
        Path("folder").mkdir()
        Path(NOTES).write_text("mine", encoding="utf-8")
        command("plan", PICK_AND_PLACE, "--baseline", "--no-plot", "-o", "plan")
        path = Path(name)
        with suppress(OSError):  # too long a name, or no right to make a device
            _TARGETS[target](Path(path.parts[0]))
        before = [_what(each) for each in (Path(path.parts[0]), Path(NOTES), Path("folder"))]
        ended = command(*_WRITERS[writer], "-o", name)
        after = [_what(each) for each in (Path(path.parts[0]), Path(NOTES), Path("folder"))]
        changed = [one for one, other in zip(before, after, strict=True) if one and one != other]
        if changed and not (target == "file" and ended.code == 0):
            return f"{changed} is replaced"
        return "; ".join(left_behind(Path("folder"))) or ended.wrong()

    return Attempt(f"{writer} -o {name}, {target}", made)


def _what(path: Path) -> tuple[object, ...]:
    """What is at a path: its kind, what it leads to, and the text in it."""
    if not os.path.lexists(path):
        return ()
    kind = stat.S_IFMT(path.lstat().st_mode)
    text = path.read_bytes() if stat.S_ISREG(kind) else b""
    return kind, path.readlink() if path.is_symlink() else None, text


_CACHES = ("file", "pipe", "garbage", "anybody's", "noexec", "read only", "loop", "deep", "device")
_GARBAGE = b"\x7fELF" + bytes(100)
_MOUNTS = {
    "noexec": 'mount -t tmpfs -o noexec none "$0" && cp "$1"/*.s* "$0" && shift && exec "$@"',
    "read only": 'mount -t tmpfs -o ro none "$0" && shift && exec "$@"',
}


def caches(rng: Generator) -> Attempt:
    """A folder for compiled code that is none, or whose files are no use: a plan all the same."""
    cache, way = Path("cache").absolute(), str(rng.choice(_CACHES))

    def made() -> str:
        cache.write_bytes(b"") if way == "file" else None
        os.mkfifo(cache) if way == "pipe" else None
        cache.symlink_to(cache) if way == "loop" else None
        folder = {"deep": cache / "a" / "b", "device": Path("/dev/null")}.get(way, cache)
        words = [sys.executable, "-m", "deltaopt", "plan", str(PICK_AND_PLACE), "--no-plot"]
        if way in ("garbage", "anybody's", *_MOUNTS):
            cache.mkdir(mode=0o777 if way == "anybody's" else 0o700)
        for file in cache_directory().glob("*.so") if way == "garbage" else ():
            (cache / file.name).write_bytes(_GARBAGE)
            right = sha256(_GARBAGE).hexdigest()
            (cache / file.name).with_suffix(".sha256").write_text(right, encoding="utf-8")
        if way in _MOUNTS:
            own = [str(cache), str(cache_directory())]
            words = ["unshare", "-m", "sh", "-c", _MOUNTS[way], *own, *words]
        environment = os.environ | {CACHE: str(folder)}
        ended = subprocess.run(words, env=environment, capture_output=True, check=False, text=True)
        lines = ended.stderr.strip().splitlines()
        if ended.returncode == 0 and "Traceback" not in ended.stderr:
            return ""
        return f"exit code {ended.returncode}, {len(lines)} lines: {' / '.join(lines[-2:])}"

    return Attempt(way, made)


_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def signals(rng: Generator) -> Attempt:
    """A command is stopped at an instant: its files are all there or none, and one line is said."""
    number, instant = _SIGNALS[rng.integers(3)], float(rng.uniform(0.1, 3.0))
    old, what = bool(rng.integers(2)), str(rng.choice(["plan", "report", "several", "compile"]))

    def made() -> str:
        folder, before = Path("work/out"), dict[str, bytes]()
        folder.mkdir(parents=True)
        if old:
            command("plan", PICK_AND_PLACE, "--baseline", "-o", folder)
            (folder / NOTES).write_text("mine", encoding="utf-8")
            before = contents(folder)
        words = ["plan", str(PICK_AND_PLACE), "-o", str(folder)]
        words += ["--report"] * (what == "report") + ["--tolerance", "1e-5"] * (what == "several")
        cache = Path("cache").absolute() if what == "compile" else None
        ended = run_until(words, instant, number, group=False, cache=cache)
        if ended.outside or any("import end_at_once" in line for line in ended.errors):
            return ""  # Python had not come to deltaopt's own handlers yet
        problems = [*faults_of_files(folder, before)] if what != "report" else []
        problems += left_behind(folder)
        said = [line for line in ended.errors if line.startswith("deltaopt:")]
        if ended.code not in (0, 128 + number, -number) or len(said) > 1:
            problems.append(f"exit code {ended.code}: {' / '.join(said[-3:])}")
        return "; ".join(problems)

    return Attempt(f"{what}, {number.name} after {instant:.3f} s, an old plan: {old}", made)


def checks(rng: Generator) -> Attempt:
    """A shipped scene with some numbers changed a little: check says what plan then finds."""
    file, robot, scene = drawn(rng)
    found = [place for place in places(scene) if place[0] not in ("objective", "path")]
    for place in (found[i] for i in rng.integers(len(found), size=2)):
        value = at(scene, place)
        if isinstance(value, float):
            scene = replaced(scene, place, round(value * rng.uniform(0.5, 1.5), 4))

    def made() -> str:
        written(robot, scene)
        checked, plan = command("check", SCENE), command("plan", SCENE, "--no-plot")
        words = re.search(r"(?<![\w.])-?(nan|inf|None)(?![\w.])", checked.output)
        if words:
            return f"check prints {words[0]}"
        if {checked.code, plan.code} == {0, 2} or (checked.code, plan.code) == (1, 0):
            return f"check: {checked.code}, {checked.last}; plan: {plan.code}, {plan.last}"
        return checked.wrong() or plan.wrong()

    return Attempt(f"{file.name}: {scene}", made)


KINDS: dict[str, Kind] = {
    "options": options,
    "inputs": inputs,
    "outputs": outputs,
    "caches": caches,
    "signals": signals,
    "checks": checks,
}
