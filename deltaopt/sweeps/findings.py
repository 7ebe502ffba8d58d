"""What a table of a sweep says: which plans there are, and which are best. Tables are pandas
DataFrames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from deltaopt.sensitivity.keys import unit_of
from deltaopt.sweeps.points import FACTS

_SHOWN = 5
_TOLD = ("duration", "parts_per_minute", "rms_share", "singularity", "limited_by")
_MEASURED = ("duration", "parts_per_minute", "rms_share", "singularity", "gap", "seconds")


def varied(table: Any, names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Those of some columns with several values: of numbers, and of texts."""
    found = [name for name in names if table[name].nunique(dropna=False) > 1]
    of_numbers = [name for name in found if table[name].dtype.kind in "if"]
    return of_numbers, [name for name in found if name not in of_numbers]


def best_compromises(table: Any, pair: Sequence[str]) -> Any:
    """The rows of which no other is less in one of two columns and no more in the other."""
    first, second = pair
    rows = table.dropna(subset=[*pair]).sort_values([first, second])
    return rows[rows[second] < rows[second].cummin().shift(fill_value=float("inf"))]


def told(
    table: Any,
    names: Sequence[str],
    column: str,
    series: Sequence[str] = (),
    worst: bool = False,
) -> Iterator[str]:
    """Lines on the plans: those with the least of a column, or the most of it for the ``worst``,
    and why others are none. The best of each of some ``series``, such as robots, comes first."""
    rows = table.dropna(subset=["duration"]).sort_values(column, ascending=not worst)
    first = f", {'worst' if worst else 'best'} first:" if len(rows) else ":"
    yield f"{len(rows)} of {len(table)} points have a plan{first}"
    heads = rows.drop_duplicates([*series]).index if series else []
    order = [*heads, *rows.index.difference(heads, sort=False)][:_SHOWN]
    shown = ["point", *dict.fromkeys([*series, *names, column, *_TOLD])]
    if order:
        over = 100 * (rows.loc[order, column] / table[column].min() - 1)
        rows = rows.loc[order, shown].dropna(axis=1, how="all")
        if over.notna().all():
            rows["over least"] = over.map("{:+.1f} %".format)
        yield rows.to_string(index=False, float_format="{:.5g}".format, na_rep="")
    limits = table["limited_by"].value_counts().head(_SHOWN)
    if len(limits):
        each = (f"{name} ({number})" for name, number in limits.items())
        yield f"most of the time at: {', '.join(each)}"
    errors = table["error"].dropna().astype(str)
    alike = errors.groupby(errors.str.replace(r"-?\d[\d.e-]*", "", regex=True))
    for sentence, number in (
        alike.agg(["first", "size"]).nlargest(_SHOWN, "size").itertuples(index=False)
    ):
        yield f"{number} of {len(table)}: {sentence}"


def message(table: Any, names: Sequence[str], column: str) -> str:
    """Where a column is least, and how much more it is elsewhere, in a sentence."""
    best = table.loc[table[column].idxmin()]
    values = (f"{best[n]:.5g}" if table[n].dtype.kind in "if" else str(best[n]) for n in names)
    pairs = zip(names, values, strict=True)
    where = ", ".join(f"{name} = {value} {unit_of(name)}".rstrip() for name, value in pairs)
    most = 100 * (table[column].max() / best[column] - 1)
    least = f"{FACTS.get(column, column)} is least at {where}: {best[column]:.4g}"
    return f"{least}; elsewhere up to {most:.0f} % more"


def quantiles(table: Any) -> str:
    """A table of the distribution of durations and of what motors and places allow."""
    found = table[[*_MEASURED]].dropna(axis=1, how="all").describe([0.1, 0.5, 0.9, 0.99])
    return str(found.drop(["count", "mean", "std"]).T.to_string(float_format="{:.4g}".format))
