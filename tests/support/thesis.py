"""The solver of the thesis (sections 6.4.3, 7.6.2, 7.6.3), which the product's exact one is held against."""

from __future__ import annotations

import numpy as np


def solve(d: np.ndarray, target: np.ndarray, old: np.ndarray, k: float = 0.05, h: float = 1.2) -> np.ndarray:
    """Weights (4,) of one vertex: `d` (3, 4) is where its bones would take it, `target` (3,), `old` weights (4,)."""
    free, p = d[:, :3] - d[:, 3:], target - d[:, 3]
    a = free.T @ free + k * k * (np.eye(3) + np.ones((3, 3)))
    b = free.T @ p + k * k * (old[:3] - old[3] + 1)
    w = _minimiser(a, b)
    for j in range(3):
        if w[j] < -1.2e-8:
            a[j, j] += h
            w = _minimiser(a, b)
    if w[3] < -1.2e-8:
        w = _minimiser(a + h, b + h)
    low, high = min(0, w.min()), max(1, w.max())
    w = (w - low) / (high - low)
    return w / w.sum()


def _minimiser(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    w = np.linalg.solve(a, b)
    return np.append(w, 1 - w.sum())
