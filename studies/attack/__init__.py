"""Hostile input of many kinds: a right answer, or one clear sentence; in time, without a traceback.

Attempts are drawn at random, a fixed number of each kind. Each runs in a process of its own and is
judged by checks that share no code with what is attacked:

  good       the right answer, or a refusal: exit code 1 or 2 and one sentence, or the documented
             error of Python
  wrong      verified, accepted or written where these checks say no; half of the input ignored;
             half-written files; what is harmless refused; a refusal that does not say why
  traceback  an error that nobody has foreseen
  hang       no end within a minute of the processor

Every attempt that is not good is printed with its input; --only KIND:NUMBER makes it again.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ThreadPoolExecutor

from deltaopt.cli.arguments import WrongUsage, one_or_more, seed
from deltaopt.files.progress_bar import ProgressBar
from studies.attack.attempts import GOOD, VERDICTS, Row, row_of
from studies.attack.kinds import COSTLY, KINDS
from studies.kept_rows import kept_rows
from studies.problems import add_directory
from studies.text_table import table

SMALL = {"number": 2, "kinds": ("motions",)}
_CHEAPER = 3
"""How many times fewer attempts there are of kinds that compile or plan much."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--number", type=one_or_more, default=30, help="of each kind; costly: 1/3")
    parser.add_argument("--seed", type=seed, default=1, help="of the attempts (default: 1)")
    parser.add_argument("--workers", type=one_or_more, default=2, help="processes (default: 2)")
    parser.add_argument("--only", metavar="KIND:NUMBER", help="one attempt, made again")
    parser.set_defaults(kinds=tuple(KINDS))
    add_directory(parser, "attack", "a CSV file of all attempts, for each seed")


def run(arguments: argparse.Namespace) -> int:
    """Make attempts, print a table by kind and every one that is not good."""
    if arguments.only:
        kind, _, number = arguments.only.partition(":")
        if kind not in KINDS or not number.isdecimal():
            raise WrongUsage(f"--only is {arguments.only!r}; KIND:NUMBER is needed")
        row = row_of(KINDS, kind, arguments.seed, int(number))
        print(f"{row.told}\n{_line(row)}")
        return int(row.verdict != GOOD)
    rows = _rows(arguments)
    others = [row for row in rows if row.verdict != GOOD]
    print(_table(rows))
    print(f"{len(rows) - len(others)} of {len(rows)} attempts are good")
    for row in others:
        print(f"{_line(row)}\n    {row.told}")
    return int(bool(others))


def _rows(arguments: argparse.Namespace) -> list[Row]:
    """All rows: from the file of the seed, or made and appended."""
    fewer = max(1, arguments.number // _CHEAPER)
    keys = [
        (kind, i)
        for kind in arguments.kinds
        for i in range(fewer if KINDS[kind] in COSTLY else arguments.number)
    ]
    with ThreadPoolExecutor(arguments.workers) as pool:
        return kept_rows(
            arguments.directory / f"attempts_{arguments.seed}.csv",
            Row,
            keys,
            lambda row: (row.kind, row.number),
            lambda key: row_of(KINDS, key[0], arguments.seed, key[1]),
            ProgressBar().counting(len(keys), "attempts"),
            pool,
        )


def _line(row: Row) -> str:
    return f"{row.verdict}: --only {row.kind}:{row.number} ({row.seconds:.1f} s): {row.problem}"


def _table(rows: list[Row]) -> str:
    """Attempts and verdicts of each kind, and of all."""
    kinds = list(dict.fromkeys(row.kind for row in rows))
    lines: list[tuple[str, ...]] = [("kind", "attempts", *VERDICTS, "s")]
    for kind in [*kinds, "all"]:
        own = [row for row in rows if kind in (row.kind, "all")]
        counts = [sum(row.verdict == verdict for row in own) for verdict in VERDICTS]
        seconds = sum(row.seconds for row in own)
        lines.append((kind, *map(str, (len(own), *counts)), f"{seconds:.0f}"))
    return table(lines)
