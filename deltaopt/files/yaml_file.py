"""Reading the part of YAML that scenes and robots use: mappings, lists, numbers and text.

A plain scalar that looks like a decimal number is a number (``1``, ``1e-3`` and ``1.e3``
alike); every other scalar is text.  So nothing is ever a date, a boolean, a null, an octal or
a sexagesimal number by surprise: ``payload: yes`` is text, which the records then refuse.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import yaml

from deltaopt.errors import SceneError, inside
from deltaopt.files.atomic_write import write_text
from deltaopt.files.regular_file import content_of

_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_NAMES, _INDEX = re.compile(r"\[\d+\]|[^.\[]+"), re.compile(r"\[\d+\]")
"""Of a dotted key: names of mappings, and places in lists."""
_WORD = re.compile(r"<<|\w[][\w .-]{0,99}")  # the first is YAML's own, for merging
"""What a key may be. Whatever else a file has is not quoted: it may be no robot or scene at all."""
_DEEPEST = 20
"""Largest depth of nesting: a robot file needs 3, and PyYAML's time and stack limit the depth."""
_LARGEST = 1
"""Largest size of a file, MB: a robot has a few hundred bytes, and PyYAML is slow with more."""
_LONGEST = 20_000
"""Most lines of a file, and most signs and values in it: a robot has a hundred, and PyYAML takes a
second or two for so many."""
_UNDER_NO_KEY = "expected <block end>, but found '<block mapping start>'"
"""What PyYAML says of a key that is indented as if it were inside another one."""
_OPENING = (
    yaml.BlockMappingStartToken,
    yaml.BlockSequenceStartToken,
    yaml.FlowMappingStartToken,
    yaml.FlowSequenceStartToken,
)
_CLOSING = (yaml.BlockEndToken, yaml.FlowMappingEndToken, yaml.FlowSequenceEndToken)


def read_yaml(file: Path) -> dict[str, object]:
    """Read the mapping of keys to values in a YAML file.

    Raises SceneError, naming the file, if it cannot be read or is not such a mapping.
    """
    with inside(file=file):
        content = _parsed(_text(file))
    if not isinstance(content, dict):
        # What stands in it is not quoted: a file named by mistake may hold secrets.
        problem = "is a list" if isinstance(content, list) else "is a single value"
        raise SceneError(file, "", content, "a mapping of keys to values", problem)
    return content


def place_of(file: Path, key: str) -> str:
    """Where the value of a dotted key, such as keep_out[2].box, stands in a file: "line 3, column
    10".

    Where the file has no such key, it is the innermost mapping that should have it; empty if that
    is the whole file, or if the file cannot be read.
    """
    try:
        node = _composed(_text(file))
    except (SceneError, yaml.YAMLError):
        return ""
    found = None
    for name in _NAMES.findall(key):
        node = _inside(node, name)
        found = node or found
    if found is None:
        return ""
    return f"line {found.start_mark.line + 1}, column {found.start_mark.column + 1}"


@contextmanager
def placed_in(file: Path, named: Callable[[str], str] = str) -> Iterator[None]:
    """What is wrong in the content of a file is raised with file, line and column; ``named``: how
    the file calls the key of what is wrong."""
    try:
        yield
    except SceneError as error:
        key = named(error.key)
        raise error.at(file, key, place_of(file, key)) from None


def _inside(node: yaml.Node | None, name: str) -> yaml.Node | None:
    """The value of a name in a mapping, or of an index, "[2]", in a list; None without one."""
    if isinstance(node, yaml.SequenceNode) and _INDEX.fullmatch(name):
        index = int(name[1:-1])
        return node.value[index] if index < len(node.value) else None
    inner = node.value if isinstance(node, yaml.MappingNode) else []
    return next((value for each, value in inner if each.value == name), None)


def _text(file: Path) -> str:
    try:
        return content_of(file, _LARGEST).decode("utf-8")  # PyYAML skips a byte order mark
    except OSError as error:
        raise _unusable(str(error.strerror)) from None
    except UnicodeDecodeError as error:
        raise _unusable(f"is not UTF-8 text (byte {error.start})") from None


def _parsed(text: str) -> object:
    try:
        root = _composed(text)
        if root is None:
            raise _unusable("is empty")
        return _content(root)
    except yaml.YAMLError as error:
        raise _unusable(f"is not valid YAML ({_reason(error)})") from None


def _reason(error: yaml.YAMLError) -> str:
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark:
        mark, problem = error.problem_mark, error.problem
        if problem == _UNDER_NO_KEY:
            problem = (
                "farther right than the lines above; is the # before the key above it removed?"
            )
        return f"line {mark.line + 1}, column {mark.column + 1}: {problem}"
    return "it contains a control character"  # PyYAML's only complaint without a mark


class _Scanned(yaml.BaseLoader):
    """What composes the tokens of a text that has been scanned: scanning is most of the time."""

    def __init__(self, tokens: list[yaml.Token]) -> None:
        super().__init__("")
        self.tokens = tokens
        self.done = True


@lru_cache(maxsize=8)
def _composed(text: str) -> yaml.Node | None:
    """The nodes of a text, which are only read; None if it is empty.

    Those of the last few texts are kept: many scenes name the same robot. Raises YAMLError, and
    SceneError for a trap.
    """
    loader = _Scanned(_tokens(text))
    try:
        found: yaml.Node | None = loader.get_single_node()
        return found
    finally:
        loader.dispose()


def _tokens(text: str) -> list[yaml.Token]:
    """The tokens of a text. Refuses aliases, tags, deep nesting and long lists, none of which a
    robot or scene needs.

    A few aliases can expand to gigabytes, and PyYAML's time is quadratic in the depth.
    """
    if text.count("\n") > _LONGEST:
        raise _unusable(f"has more than {_LONGEST} lines")
    depth, found = 0, list[yaml.Token]()
    for number, token in enumerate(yaml.scan(text, Loader=yaml.BaseLoader)):
        line = token.start_mark.line + 1
        if number > _LONGEST:
            raise _unusable(f"has too many values (line {line})")
        depth += isinstance(token, _OPENING) - isinstance(token, _CLOSING)
        if depth > _DEEPEST:
            raise _unusable(f"is nested too deeply (line {line})")
        if isinstance(token, yaml.AliasToken | yaml.TagToken):
            raise _unusable(f"uses an alias or a tag (line {line})")
        found.append(token)
    return found


def _content(node: yaml.Node) -> object:
    if isinstance(node, yaml.MappingNode):
        return _mapping(node)
    if isinstance(node, yaml.SequenceNode):
        return [_content(item) for item in node.value]
    is_plain = isinstance(node, yaml.ScalarNode) and node.style is None
    return float(node.value) if is_plain and _NUMBER.fullmatch(node.value) else node.value


def _mapping(node: yaml.MappingNode) -> dict[str, object]:
    mapping: dict[str, object] = {}
    for key_node, value_node in node.value:
        line = key_node.start_mark.line + 1
        key = key_node.value
        if not (isinstance(key, str) and _WORD.fullmatch(key)):
            raise _unusable(f"has a key that is no word (line {line})")
        with inside(key=key):
            value = _content(value_node)
        if key in mapping:
            raise SceneError(None, key, value, "each key once", f"is given again in line {line}")
        mapping[key] = value
    return mapping


def _unusable(problem: str) -> SceneError:
    return SceneError(None, "", None, "a YAML file of keys and values", problem)


def write_yaml(file: Path, content: dict[str, object], comment: str = "") -> None:
    """Write a mapping of keys to values, in their order, after a comment of one line: a file that
    is whole or not there. Raises OSError, which names it."""
    head = f"# {' '.join(comment.split())}\n" if comment else ""
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
    write_text(file, head + text)
