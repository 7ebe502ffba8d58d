"""``python -m studies.bench``: the same command, without what the other studies need installed."""

from __future__ import annotations

import sys

from deltaopt.cli import Parser, exit_code
from studies import bench

parser = Parser(prog="python -m studies.bench", description=bench.HELP)
bench.add_arguments(parser)
arguments = parser.parse_args()
sys.exit(exit_code(lambda: bench.run(arguments)))
