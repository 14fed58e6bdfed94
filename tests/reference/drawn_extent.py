"""How much of its axes a picture fills: ends that are off leave a part empty, or cut something."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from matplotlib.transforms import Bbox


def extents(ax, across):
    """Boxes of what is drawn; of lines and bands `across` the whole axes the side with a value."""
    for artist in (*ax.lines, *ax.patches):
        valued = artist.get_transform().contains_branch_seperately(ax.transData)
        if artist.get_visible() and (all(valued) or (across and any(valued))):
            path = artist.get_path()
            if artist in ax.patches:
                path = path.transformed(artist.get_patch_transform())
            corners = path.vertices[np.isfinite(path.vertices).all(axis=1)]
            if len(corners):
                ends = np.where(valued, [corners.min(axis=0), corners.max(axis=0)], np.nan)
                yield Bbox(ends)
    for artist in ax.collections:
        yield artist.get_datalim(ax.transData)
    for artist in ax.images:
        left, right, bottom, top = artist.get_extent()
        yield Bbox([[min(left, right), min(bottom, top)], [max(left, right), max(bottom, top)]])


def _spans(ax, which, across):
    """Limits of an axis and the extent of the data on it, on the scale that it is drawn in."""
    limits = np.sort(getattr(ax, f"get_{which}lim")()).astype(float)
    boxes = [getattr(own, f"interval{which}") for own in extents(ax, across)]
    data = np.array([own for own in boxes if np.isfinite(own).all()]).ravel()
    if not data.size:
        return None
    if getattr(ax, f"get_{which}scale")() == "log":
        # what lies decades below is cut
        return np.log(limits), np.log(np.maximum(data, limits[0]))
    # from nothing on, which is a part of what is shown
    return limits, np.append(data, 0.0) if limits[0] == 0.0 else data


def badly_filled(figure, least=0.45, room=0.05, *, across=True):
    """Axes whose data fill less than a share of them, or lie beyond their ends.

    Strips with the same limits and scales are taken together.
    """
    alike = defaultdict(list)
    for ax in figure.axes:
        # what is drawn to scale shows a part
        shown = ax.get_visible() and ax.get_aspect() == "auto"
        for which in "xy":
            spans = _spans(ax, which, across) if shown else None
            if spans is not None:
                limits, data = spans
                scale = getattr(ax, f"get_{which}scale")()
                alike[which, scale, *limits.tolist()].append((data.min(), data.max()))
    wrong = []
    for (which, _, low, high), spans in alike.items():
        first, last = min(own[0] for own in spans), max(own[1] for own in spans)
        beyond = room * (high - low)
        share = (min(last, high) - max(first, low)) / (high - low)
        # a single point fills nothing
        empty = last - first > 0.01 * (high - low) and share < least
        if empty or first < low - beyond or last > high + beyond:
            wrong.append(f"{which} from {low:.4g} to {high:.4g}: data {first:.4g} to {last:.4g}")
    return wrong
