"""Labels of a chart that overlap each other, lie over another panel, or leave their own."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

DOTS = 200
"""Per inch, of all charts in the style of the package."""
_SLACK = 1.5
"""Points of print by which boxes may overlap: a box is a little larger than its ink."""


def overlaps(figure: Figure) -> list[str]:
    """A sentence for each pair of labels, and for each label and panel, that overlap."""
    inside = [(axes, text) for axes in figure.axes for text in _inside(axes)]
    outside = [text for axes in figure.axes for text in _outside(axes)]
    outside += [text for text in _of_figure(figure) if _shown(text)]
    boxes = [(text.get_text(), _box(text)) for text in [*(t for _, t in inside), *outside]]
    found = [
        f"{one!r} overlaps {other!r}"
        for (one, first), (other, second) in combinations(boxes, 2)
        if first.overlaps(second)
    ]
    panels = [_shrunk(axes.get_window_extent()) for axes in figure.axes if axes.axison]
    found += [
        f"{text.get_text()!r} lies over a panel"
        for text in outside
        for panel in panels
        if _box(text).overlaps(panel)
    ]
    found += [
        f"{text.get_text()!r} leaves its panel"
        for axes, text in inside
        if not _contains(axes.get_window_extent(), _box(text))
    ]
    page = figure.bbox
    return found + [f"{name!r} leaves the page" for name, box in boxes if not _contains(page, box)]


def _inside(axes: Axes) -> Iterator[Text]:
    """Texts that belong into the panel, those of its legend if that is in it."""
    yield from (text for text in axes.texts if _shown(text) and not _is_beside(axes, text))
    legend = axes.get_legend()
    if legend is not None and axes.get_window_extent().overlaps(
        _shrunk(legend.get_window_extent())
    ):
        yield from (text for text in legend.get_texts() if _shown(text))


def _outside(axes: Axes) -> Iterator[Text]:
    """Texts around a panel: titles, names of the axes, numbers of their ticks, a legend there."""
    texts = [axes.title, axes._left_title, axes._right_title]
    if axes.axison:
        for axis in (axes.xaxis, axes.yaxis):
            texts += [axis.label, axis.offsetText, *_ticks(axis)]
    legend = axes.get_legend()
    if legend is not None:
        inside = set(_inside(axes))
        texts += [text for text in legend.get_texts() if text not in inside]
    texts += [text for text in axes.texts if _is_beside(axes, text)]
    yield from (text for text in texts if _shown(text))


def _is_beside(axes: Axes, text: Text) -> bool:
    """Whether a text begins where the panel ends, as the name of a line at the line's end does."""
    return bool(_box(text).x0 >= axes.get_window_extent().x1)


def _ticks(axis: Axis) -> Iterator[Text]:
    """Labels of the ticks that are drawn."""
    for tick in axis._update_ticks():
        yield from (text for text in (tick.label1, tick.label2) if text.get_visible())


def _of_figure(figure: Figure) -> Iterator[Text]:
    yield from figure.texts
    for legend in figure.legends:
        yield from legend.get_texts()


def _shown(text: Text) -> bool:
    return text.get_visible() and bool(text.get_text().strip())


def _box(text: Text) -> Bbox:
    return _shrunk(text.get_window_extent())


def _shrunk(box: Bbox) -> Bbox:
    return box.padded(-_SLACK * DOTS / 72)


def _contains(outer: Bbox, box: Bbox) -> bool:
    return bool(
        outer.x0 <= box.x0 and outer.y0 <= box.y0 and box.x1 <= outer.x1 and box.y1 <= outer.y1
    )
