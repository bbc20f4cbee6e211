"""Garments follow refined skin: what refinement adds to the body at rest is added to them where they lie on it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import native
from .character import Character

# Garments take all of the body's offset up to this share of its diagonal away, and nothing from three times that.
_NEAR = 0.02


@dataclass(frozen=True)
class Follower:
    """A garment whose vertices (n,) hang on body vertices `corners` (n, 3) with `shares` (n, 3)."""

    character: Character
    corners: NDArray[np.uint32]
    shares: NDArray[np.float64]

    def positions(self, pose_from_rest: NDArray[np.float64], displacement: NDArray[np.float32]) -> NDArray[np.float32]:
        """(n, 3) skinned, moved by the body's posed displacement (V, 3)."""
        moved = np.einsum("nk,nkc->nc", self.shares, displacement[self.corners])
        return self.character.skinned(pose_from_rest) + moved.astype(np.float32)


def follow(body: Character, garment: Character, body_from_garment: NDArray[np.float64]) -> Follower:
    """Hang a garment on the body's rest surface. Raises native.NativeError."""
    places = garment.positions @ body_from_garment[:3, :3].T + body_from_garment[:3, 3]
    triangle, shares, distance = native.closest(
        body.name, body.positions, body.triangles, body.rows, len(body.bones), places.astype(np.float32)
    )
    diagonal = float(np.linalg.norm(np.ptp(body.positions, axis=0)))
    near = np.clip(1.5 - distance / (2 * _NEAR * diagonal), 0, 1)
    return Follower(garment, body.triangles[triangle], shares * near[:, None])
