"""Turns the benchmark's figures into a table (results.md) and a plot (results.png)."""

from __future__ import annotations

import os
import platform
from pathlib import Path

import matplotlib
import meshes
import numpy as np
from machine import processor

matplotlib.use("Agg")
import matplotlib.pyplot as plt

Figures = dict[str, dict[str, dict]]  # by size, then by method: wall, cpu, peak_mb, stages, difference


def own_solve(figures: dict[str, dict]) -> float:
    """Seconds of our order + factor + solve of the one-component system, assembled as the peers get it."""
    stages = figures["skinwright one component"]["stages"]
    return stages["factor"] + stages["solve"]


def best_cholmod(figures: dict[str, dict]) -> float:
    """The better of the two orderings."""
    return min(figures["cholmod amd"]["wall"], figures["cholmod metis"]["wall"])


# Peer and ours, by method.
RATIOS = {
    "arrays in, arrays out, against the libigl pipeline": ("libigl", "skinwright"),
    "the same with 10 smoothing passes": ("libigl smoothed", "skinwright smoothed"),
    "hierarchy + closest points, against libigl's AABB tree": ("libigl closest points", "skinwright closest points"),
    "inside Blender: the add-on, against Data Transfer, which inpaints nothing": (
        "blender data transfer",
        "blender add-on",
    ),
}
CURVES = {
    "Skinwright": ("skinwright", "tab:blue", "-"),
    "Skinwright, 10 smoothing passes": ("skinwright smoothed", "tab:blue", "--"),
    "libigl pipeline": ("libigl", "tab:orange", "-"),
    "libigl pipeline, 10 smoothing passes": ("libigl smoothed", "tab:orange", "--"),
    "Blender Data Transfer (no inpainting)": ("blender data transfer", "tab:gray", ":"),
}


def write(figures: Figures, plans: dict, operators: list[str], folder: Path, load: float) -> None:
    """Both files; `operators` are the lines of operator_wall.py, of each Blender."""
    vertices = {size: len(meshes.load(size).positions) for size in figures}
    report = _report(figures, vertices, plans, load) + _inside_blender(operators)
    (folder / "results.md").write_text("\n".join(report) + "\n")
    _plot(figures, vertices, folder / "results.png")


def slope(vertices: list[int], walls: list[float]) -> float | None:
    """Exponent of the growth from 20k on, by least squares in the logarithms."""
    large = np.array(vertices) > 10_000
    if large.sum() < 2:
        return None
    return float(np.polyfit(np.log(vertices)[large], np.log(walls)[large], 1)[0])


def _report(figures: Figures, vertices: dict[str, int], plans: dict, load: float) -> list[str]:
    lines = [
        "# Benchmark",
        "",
        "Made by `make bench`. Source: 10,682 vertices, 60 bones; target: a tunic with a folded skirt, about 40 %",
        "unmatched. Medians; ours and the peers alternate, each in a process of its own. Where answers were compared",
        "they are equal: masks identical, largest difference of a weight below. The peers are described in peers.py.",
        "",
        f"{processor()}, {os.cpu_count()} cores, {platform.platform()}, Python {platform.python_version()};",
        f"load before the run {load:.1f}; above 1 it makes walls of two threads too long, ours more than the peers'.",
        "",
        "![Time against size](results.png)",
        "",
    ]
    for measure in ("wall", "cpu"):
        lines += _ratios(figures, vertices, measure)
    for size, methods in figures.items():
        plan = plans[size]
        lines += [f"## {size}: {vertices[size]:,} vertices, {plan.rounds} processes of {plan.calls} calls", ""]
        lines += [_row("method", "wall s", "CPU s", "peak MB", "largest difference"), _row("---", *["---:"] * 4)]
        for method, entry in methods.items():
            difference = "" if entry["difference"] is None else f"{entry['difference']:.1e}"
            timing = (f"{entry['wall']:.3f}", f"{entry['cpu']:.3f}", f"{entry['peak_mb']:.0f}")
            lines.append(_row(method, *timing, difference))
        for method in ("skinwright", "blender add-on"):
            stages = ", ".join(f"{stage} {took:.3f} s" for stage, took in methods[method]["stages"].items())
            lines += ["", f"{method} by stage: {stages}."]
        lines.append("")
    return lines


def _inside_blender(operators: list[str]) -> list[str]:
    if not operators:
        return []
    return [
        "## The operator inside Blender against the native call alone",
        "",
        "Made by operator_wall.py, in turn; Blender's part is reading meshes and weights and writing the groups.",
        "",
        *operators,
    ]


def _ratios(figures: Figures, vertices: dict[str, int], measure: str) -> list[str]:
    lines = [
        f"## How many times less {measure} time",
        "",
        _row("", *(f"{size} ({vertices[size]:,})" for size in figures)),
        _row("---", *["---:"] * len(figures)),
    ]
    for name, (peer, own) in RATIOS.items():
        lines.append(_row(name, *(f"{f[peer][measure] / f[own][measure]:.1f}" for f in figures.values())))
    if measure == "wall":  # our stages know no other time
        name = "order + factor + solve of one component, 60 bones, against CHOLMOD's better ordering"
        lines.append(_row(name, *(f"{best_cholmod(f) / own_solve(f):.1f}" for f in figures.values())))
    return [*lines, ""]


def _row(*cells: str) -> str:
    return "| " + " | ".join(cells) + " |"


def _plot(figures: Figures, vertices: dict[str, int], path: Path) -> None:
    figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
    counts = [vertices[size] for size in figures]
    for name, (method, colour, line) in CURVES.items():
        walls = [methods[method]["wall"] for methods in figures.values()]
        exponent = slope(counts, walls)
        label = name if exponent is None else f"{name}: n^{exponent:.2f}"
        axes.loglog(counts, walls, marker="o", label=label, color=colour, linestyle=line)
    axes.set_xlabel("target vertices")
    axes.set_ylabel("seconds (wall, median)")
    axes.set_title("Weight transfer with inpainting: time against size")
    axes.grid(which="major", alpha=0.4)
    axes.legend(fontsize=9)
    figure.savefig(path, dpi=110)
    plt.close(figure)
