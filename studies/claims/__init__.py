"""What Orsino, Coutinho and Hess-Coelho claim of their models, measured, each with its uncertainty.

table1     Table I: derivation, interpretability and computing effort of K, L_E and L_I, in numbers
share      K and L_E take 83 % of the time of L_I
singular   near singular configurations L_I is more subject to numerical errors
"""

from __future__ import annotations

import argparse

from deltaopt.cli.arguments import WrongUsage, one_or_more
from deltaopt.files.progress_bar import ProgressBar

HELP = "the paper's claims about its models, measured"
NAMES = ("table1", "share", "singular")
SMALL = {"rounds": 3, "motions": 1, "digits": 30, "families": ("stretched",)}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("claims", nargs="*", default=NAMES, metavar="CLAIM", help=", ".join(NAMES))
    for name, default, what in (
        ("rounds", 200, "simulations of each model, in turn"),
        ("motions", 20, "random motions at each state near a singularity"),
        ("digits", 50, "of the arithmetic they are held against"),
    ):
        parser.add_argument(
            f"--{name}", type=one_or_more, default=default, help=f"{what} ({default})"
        )
    parser.set_defaults(families=("stretched", "sideways", "coplanar", "upright"))


def run(arguments: argparse.Namespace) -> int:
    from studies.claims import share, singular, table1

    unknown = [name for name in arguments.claims if name not in NAMES]
    if unknown:
        raise WrongUsage(f"{unknown[0]} is no claim; {', '.join(NAMES)} are")
    for name in arguments.claims:
        if name == "table1":
            print(table1.report(table1.measure()))
        elif name == "share":
            print(share.report(share.measure(arguments.rounds, ProgressBar())))
        else:
            sizes = arguments.motions, arguments.digits, arguments.families
            print(singular.report(singular.measure(ProgressBar(), *sizes)))
        print()
    return 0
