"""Hold the numbers of the pages against what commands last printed.

What a command printed is kept in docs/outputs/NAME.txt, below lines of its own: the command, the
code that its numbers depend on (all of deltaopt/ where that is left out), and the commit that it
ran on. A page says where a block is from in the line before it, ``<!-- from: outputs/NAME.txt
-->``, or several with commas. Every line of a fenced block, and every number of a paragraph, list
or table but those in `code`, must stand in these outputs; prose may round to two digits or more.
Told too: outputs that are older than their code, those that only an earlier commit can print again,
and tables of numbers that name no output. With --again the commands of some outputs run once more,
on code that is committed.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from os import environ, getloadavg, pathsep
from pathlib import Path

from deltaopt.errors import DeltaOptError
from deltaopt.files.atomic_write import atomic_write

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
_BLOCK = re.compile(r"^```[\s\S]*?^```$|(?:^(?!```).+\n?)+", re.MULTILINE)
_MARK = re.compile(r"^<!-- from: (.+) -->$")
_NAME = re.compile(r"(?:outputs/)?(\w+)(?:\.txt)?")
_HEAD = re.compile(r"\$ (.+)\n(?:code (.+)\n)?commit (\w+).*\n([\s\S]*)")
_NUMBER = re.compile(r"(?<![\w.])\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])|(?<![\w.])\d[\d.,]*\d")
_NOT_A_RESULT = re.compile(r"`[^`]*`|\]\([^)]*\)|eqs?\. \([\d–]+\)")
"""Parts of prose whose digits nobody measured: code, links and the paper's equations."""
_TABLE = 6
"""Decimals in a table from which on it is one of results."""


@dataclass(frozen=True)
class Output:
    """What a command printed, the paths that it depends on, and the commit that it ran on."""

    name: str
    command: str
    code: tuple[str, ...]
    commit: str
    text: str

    @classmethod
    def of(cls, file: Path) -> Output:
        """Raises: DeltaOptError if the file does not begin with a command and a commit."""
        found = _HEAD.match(file.read_text(encoding="utf-8"))
        if not found:
            raise DeltaOptError(f"{file}: '$ COMMAND', 'code PATHS' and 'commit HASH' come first")
        command, code, commit, text = found.groups()
        return cls(file.stem, command, tuple((code or "deltaopt").split()), commit, text)

    def age(self) -> int:
        """How many commits have changed its code since; -1 where Git does not know."""
        asked = ["git", "rev-list", "--count", f"{self.commit}..HEAD", "--", *self.code]
        told = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=False)
        return -1 if told.returncode else int(told.stdout)

    def lacks(self, block: str) -> list[str]:
        """What of a block of a page it does not have: lines of a fence, else numbers."""
        if block.startswith("```"):
            lines = {" ".join(line.split()) for line in self.text.splitlines()}
            return [
                line for line in block.splitlines()[1:-1] if " ".join(line.split()) not in lines
            ]
        printed = {_value(number) for number in _NUMBER.findall(self.command + self.text)}
        return [number for number in _numbers(block) if not _among(number, printed)]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--again", nargs="+", metavar="NAME", help="outputs to print again first")


def run(arguments: argparse.Namespace) -> int:
    outputs = {file.stem: Output.of(file) for file in sorted((DOCS / "outputs").glob("*.txt"))}
    for name in arguments.again or ():
        if name not in outputs:
            raise DeltaOptError(f"no docs/outputs/{name}.txt; there are {', '.join(outputs)}")
        outputs[name] = _printed_again(outputs[name])
    pages = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
    wrong: list[str] = []
    used: set[str] = set()
    unmarked = 0
    for page in pages:
        for names, block in blocks(page.read_text(encoding="utf-8")):
            unmarked += not names and "|--" in block and _of_results(block)
            wrong += [
                f"{page.relative_to(ROOT)}: {what}" for what in lacking(names, block, outputs)
            ]
            used.update(names)
    for output in outputs.values():
        print(f"{output.name}: {_told(output)}; {'' if output.name in used else 'on no page; '}"
              f"{output.command}")  # fmt: skip
    print(f"{unmarked} tables of numbers name no output")
    print("\n".join(wrong) or "every number of a marked block stands in its output")
    return 1 if wrong else 0


def blocks(page: str) -> Iterator[tuple[tuple[str, ...], str]]:
    """The blocks of a page, fences and what blank lines divide, with the outputs they name."""
    names: tuple[str, ...] = ()
    for block in _BLOCK.findall(page):
        first, _, rest = block.partition("\n")
        if mark := _MARK.match(first):
            names, block = tuple(_NAME.findall(mark[1])), rest
        if block.strip():
            yield names, block
            names = ()


def lacking(names: tuple[str, ...], block: str, outputs: Mapping[str, Output]) -> Iterator[str]:
    """Sentences about what the outputs that a block names do not have."""
    yield from (f"there is no docs/outputs/{name}.txt" for name in names if name not in outputs)
    missing = [outputs[name].lacks(block) for name in names if name in outputs]
    for each in missing[0] if missing else ():
        if all(each in others for others in missing):
            yield f"'{each}' is not printed by {', '.join(names)}"


def _told(output: Output) -> str:
    from studies.__main__ import STUDIES

    age = output.age()
    if age < 0:
        return f"commit {output.commit} is unknown to Git here"
    since = f"{age} commits to its code since {output.commit}" if age else "as old as its code"
    study = re.search(r"-m studies (\w+)", output.command)
    return since if not study or study[1] in STUDIES else f"{since}, which has the study"


def _printed_again(output: Output) -> Output:
    """Run the command of an output, keep what it prints, and return that."""
    asked = ["git", "status", "--porcelain", "--", *output.code]
    if subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=True).stdout:
        raise DeltaOptError(f"{output.name}: commit changes of {' '.join(output.code)} first")
    path = f"{Path(sys.executable).parent}{pathsep}{environ['PATH']}"
    told = subprocess.run(
        output.command,
        shell=True,
        cwd=ROOT,
        env={**environ, "PATH": path},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    if not told.stdout:  # a campaign may print its failures and end with exit code 1
        raise DeltaOptError(f"{output.name}: exit code {told.returncode} of {output.command}")
    asked = ["git", "rev-parse", "--short=8", "HEAD"]
    commit = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    heads = f"$ {output.command}", f"code {' '.join(output.code)}"
    load = f"commit {commit.strip()}, load {getloadavg()[0]:.1f}"
    file = DOCS / "outputs" / f"{output.name}.txt"
    with atomic_write(file) as temporary:
        temporary.write_text("\n".join((*heads, load, told.stdout)), encoding="utf-8")
    return Output.of(file)


def _numbers(block: str) -> Iterator[str]:
    yield from _NUMBER.findall(_NOT_A_RESULT.sub("", block))


def _of_results(table: str) -> bool:
    """Whether a table is one of results rather than of keys, links or equations."""
    return sum("." in number for number in _numbers(table)) >= _TABLE


def _value(number: str) -> float:
    return float(number.strip(",").replace(",", ""))


def _among(number: str, printed: set[float]) -> bool:
    """Whether a number was printed, or is one that was, rounded to two digits or more."""
    value = _value(number)
    if value in printed:
        return True
    mantissa = number.partition("e")[0].replace(",", "")
    digits = len(mantissa.replace(".", "").lstrip("0"))
    return digits > 1 and any(float(f"{each:.{digits - 1}e}") == value for each in printed)
