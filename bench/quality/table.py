"""Tables of figures: means, ratios, and the garments that are worse than with the paper's method."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from .cases import ARTISTS, Case
from .figures import SHOWN, Figures
from .methods import REFERENCE

Results = dict[str, dict[str, Figures]]
"""Figures by case and method."""

WORSE_BY = 1.1
SLACK = {"l1_mean": 0.005, "def_p95_mm": 2.0, "torn_edges_pct": 0.05}
"""A garment is worse if one of these is more than WORSE_BY times the reference's and this much above it."""


def mean(results: Iterable[Figures], figure: str) -> float | None:
    """Over the results that have the figure."""
    values = [figures[figure] for figures in results if figure in figures]
    return sum(values) / len(values) if values else None


def worse(results: Results, method: str) -> list[str]:
    """Garments, each with the figures that are worse: the reference's, then the method's."""
    found = []
    for case, by_method in results.items():
        ours, theirs = by_method[method], by_method[REFERENCE]
        worse = [f for f in SLACK if f in ours and ours[f] > max(WORSE_BY * theirs[f], theirs[f] + SLACK[f])]
        if worse:
            found.append(f"{case}: " + ", ".join(f"{SHOWN[f]} {theirs[f]:.3g} to {ours[f]:.3g}" for f in worse))
    return found


def report(cases: Sequence[Case], results: Results) -> str:
    """Two groups of garments: painted by artists, and bound by a program."""
    lines: list[str] = []
    for title, painted in (("Painted by artists", True), ("Bound to the body by their authors", False)):
        names = [c.name for c in cases if c.artist is not None and (c.reference in ARTISTS) == painted]
        if names:
            lines += [f"## {title}: {len(names)} garments", "", *_group({name: results[name] for name in names}), ""]
    without = [case.name for case in cases if case.artist is None]
    if without:
        lines += [f"## Without a reference: {len(without)} garments", "", *_means({n: results[n] for n in without})]
    return "\n".join(lines) + "\n"


def per_garment(results: Results) -> str:
    """The three main figures of every garment and method."""
    methods = list(next(iter(results.values())))
    lines = ["| garment | " + " | ".join(methods) + " |", "|---" * (len(methods) + 1) + "|"]
    for case, by_method in results.items():
        cells = [" / ".join(_cell(by_method[m].get(f), f) for f in SLACK) for m in methods]
        lines.append(f"| {case} | " + " | ".join(cells) + " |")
    return "half L1 / deformation p95 mm / torn %\n\n" + "\n".join(lines) + "\n"


def _group(results: Results) -> list[str]:
    lines = [*_means(results), ""]
    methods = list(next(iter(results.values())))
    head = "half L1 | deformation | torn edges | half L1 to nearest | deformation to nearest | armpit to nearest"
    lines += [f"| ratio | {head} |", "|---" * 7 + "|"]
    for method in methods:
        cells = [_ratio(results, method, REFERENCE, f) for f in SLACK]
        cells += [_ratio(results, method, "nearest", f) for f in ("l1_mean", "def_p95_mm", "l1_armpit")]
        lines.append(f"| {method} | " + " | ".join(cells) + " |")
    for method in methods:
        if method not in ("nearest", REFERENCE):
            bad = worse(results, method)
            lines += ["", f"Worse than {REFERENCE} with {method}: {len(bad)} of {len(results)}", ""]
            lines += [f"- {line}" for line in bad]
    return lines


def _ratio(results: Results, method: str, other: str, figure: str) -> str:
    ours, theirs = (mean((r[m] for r in results.values()), figure) for m in (method, other))
    return f"{ours / theirs:.3f}" if ours is not None and theirs else "-"


def _means(results: Results) -> list[str]:
    methods = list(next(iter(results.values())))
    shown = {f: name for f, name in SHOWN.items() if any(f in r[methods[0]] for r in results.values())}
    lines = ["| mean | " + " | ".join(shown.values()) + " |", "|---" * (len(shown) + 1) + "|"]
    for method in methods:
        cells = [_cell(mean((r[method] for r in results.values()), f), f) for f in shown]
        lines.append(f"| {method} | " + " | ".join(cells) + " |")
    return lines


def _cell(value: float | None, figure: str) -> str:
    if value is None:
        return "-"
    return f"{value:.1f}" if figure.endswith("_mm") else f"{value:.3f}"
