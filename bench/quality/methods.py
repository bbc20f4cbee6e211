"""The methods that are compared: nearest point, and every method of the native module, under its defaults."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import cast

import numpy as np
import scipy.sparse as sp
import skinwright_native as native

from .cases import Case
from .characters import Mesh

Weighting = Callable[[Case, Mesh], np.ndarray]
"""Dense weights (V, B) for a mesh of a case: its welded one, or as it was imported."""

REFERENCE = "paper"
"""What the others are compared with."""


def nearest(case: Case, mesh: Mesh) -> np.ndarray:
    """Barycentric blend of the body's rows at the closest point, what most tools do."""
    _, faces, shares, _ = case.body.rest_surface.closest(mesh.positions)
    columns = case.body.mesh.triangles[faces].ravel()
    rows = np.repeat(np.arange(len(faces)), 3)
    blend = sp.csr_matrix((shares.ravel(), (rows, columns)), (len(faces), len(case.body.mesh.positions)))
    weights = (blend @ case.body.mesh.weights).toarray()
    return weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-12)


def transferred(method: native.MatchMethod, **settings) -> Weighting:
    """The native module's transfer."""

    def weigh(case: Case, mesh: Mesh) -> np.ndarray:
        body = case.body.skin.tocsr()
        body.sort_indices()
        weights = native.Weights(body.indptr, body.indices, body.data, body.shape[1])
        source = native.Source(case.body.mesh.positions, case.body.mesh.triangles, weights)
        return source.transfer(mesh.positions, mesh.triangles, method=method, **settings).weights.to_dense()

    return weigh


def methods() -> dict[str, Weighting]:
    """Nearest point first, then the module's methods in its order; a new one appears by itself."""
    return {"nearest": nearest} | {
        name: transferred(cast("native.MatchMethod", name)) for name in _names("MatchMethod")
    }


def _names(literal: str) -> list[str]:
    """The values of a Literal in the module's stub, which a test holds to the variants of the core's enum."""
    stub = Path(__file__).resolve().parents[2] / "rust" / "native" / "skinwright_native.pyi"
    (found,) = re.findall(rf"^{literal} = Literal\[(.*)\]$", stub.read_text(), re.MULTILINE)
    return [name.strip(' "') for name in found.split(",")]
