"""Fit an ellipse to a PV-OP plot by direct least squares; gives its width along OP (apparent
stiction) and the quality of the fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.detectors.signal.autocorrelation import centred

TOLERANCE = 0.1  # a point counts as on the ellipse at 0.9 to 1.1 of its size
# condition of points a thousand times as long as wide: a line; the fit of a thinner ellipse is
# rounding
_FLAT = 1e6


@dataclass(frozen=True)
class Ellipse:
    """An ellipse A dx^2 + B dx dy + C dy^2 = 1 about its centre (x0, y0); x is OP, y is PV."""

    A: float
    B: float
    C: float
    x0: float
    y0: float

    @property
    def axes(self) -> tuple[float, float, float]:
        """Semi-axes a >= b and the angle of a from +x (rad, -pi/2..pi/2); meaningful where x and y
        share a unit.
        """
        half = np.hypot(self.A - self.C, self.B) / 2.0
        middle = (self.A + self.C) / 2.0
        alpha = 0.5 * np.arctan2(-self.B, self.C - self.A)
        return (
            float(1.0 / np.sqrt(middle - half)),
            float(1.0 / np.sqrt(middle + half)),
            float(alpha),
        )

    @property
    def apparent_stiction(self) -> float:
        """Chord through the centre along x: 2ab / sqrt(a^2 sin^2 alpha + b^2 cos^2 alpha) = 2 /
        sqrt(A) (Eq 11.15).
        """
        return float(2.0 / np.sqrt(self.A))

    def size(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return how far points lie out, 1 on the ellipse; same shape as x and y."""
        dx = x - self.x0
        dy = y - self.y0
        return np.sqrt(np.maximum(self.A * dx * dx + self.B * dx * dy + self.C * dy * dy, 0.0))

    def fitness(self, x: np.ndarray, y: np.ndarray) -> float:
        """Return the share of points within 10 % of the ellipse, 0..1."""
        return float(np.mean(np.abs(self.size(x, y) - 1.0) <= TOLERANCE))


def fit_ellipse(x: np.ndarray, y: np.ndarray) -> Ellipse | None:
    """Fit an ellipse to points by least squares, the ellipse condition built in.

    Source: Fitzgibbon, Pilu & Fisher (1999), IEEE PAMI 21, 476-480: minimise |D a|^2 subject to 4AC
    - B^2 = 1, in the partitioned form of Halir & Flusser (1998). Not for short arcs with noise: the
    fit leans to small, flat ellipses.
    """
    # Both signals centred and scaled; one that stands still has no ellipse
    mx = float(x.mean())
    my = float(y.mean())
    u, sx = centred(x)
    v, sy = centred(y)
    if not (sx > 1e-9 * max(abs(mx), 1e-300) and sy > 1e-9 * max(abs(my), 1e-300)):
        return None
    u = u / sx
    v = v / sy

    # Scatter matrices of the quadratic and the linear part (Halir and Flusser 1998)
    D1 = np.array([u * u, u * v, v * v])
    D2 = np.array([u, v, np.ones(u.size)])
    S1 = D1 @ D1.T
    S2 = D1 @ D2.T
    S3 = D2 @ D2.T

    # Points on a line have no ellipse
    spread = np.linalg.eigvalsh(S3)
    if spread[-1] > _FLAT * spread[0]:
        return None

    # The one eigenvector that fulfils the ellipse condition 4 A C - B^2 > 0
    T = -np.linalg.solve(S3, S2.T)
    M = (S1 + S2 @ T)[[2, 1, 0]] * np.array([[0.5], [-1.0], [0.5]])
    _, vectors = np.linalg.eig(M)
    vectors = vectors.real
    elliptic = np.flatnonzero(4.0 * vectors[0] * vectors[2] - vectors[1] ** 2 > 0.0)
    if elliptic.size == 0:
        return None

    # Its centre, and the conic divided by its level there
    A, B, C = vectors[:, elliptic[0]].tolist()
    D, E, F = (T @ vectors[:, elliptic[0]]).tolist()
    bend = 4.0 * A * C - B * B
    centre = (B * E - 2.0 * C * D) / bend, (B * D - 2.0 * A * E) / bend
    level = -(F + 0.5 * (D * centre[0] + E * centre[1]))
    if level == 0.0 or A / level <= 0.0:
        return None

    # Back to the units of the signals
    A = A / level / sx**2
    B = B / level / (sx * sy)
    C = C / level / sy**2
    return Ellipse(A, B, C, mx + sx * centre[0], my + sy * centre[1])
