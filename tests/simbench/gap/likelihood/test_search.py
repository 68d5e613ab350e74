"""The search for a valve's numbers on likelihoods whose peak is known, and what it begins from."""

import numpy as np
import pytest

from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.model import Data, Fit, Spec
from simbench.gap.likelihood.search import (
    fit_with_map,
    narrow,
    scan_map,
)  # fmt: skip

THETA = {
    "T": 20.0,
    "Td": 4.0,
    "load_time": 30.0,
    "load_lag": 1.0,
    "load": 2.0,
    "noise_std": 0.1,
    "colour": 0.0,
}
NAMES = {
    kernels.PLAY: ("S",),
    kernels.STICK: ("S", "J"),
    kernels.CREEP: ("S", "J"),
    kernels.ZONE: ("D", "c"),
}


def data(**more):
    given = {
        "u": np.linspace(40.0, 60.0, 1000),
        "y": np.zeros(1000),
        "K": 1.0,
        "T": 25.0,
        "Td": 5.0,
        "noise": 0.1,
    }
    return Data(**given | more)


class Peaks:
    """An engine whose log-likelihood falls by a nat for each thousandth, squared, that a number is
    off the nearest peak.
    """

    def __init__(self, kind, *peaks, d=None):
        self.kind, self.peaks, self.data = kind, peaks, d or data()
        self.scans, self.fits = [], []

    def height(self, numbers):
        return max(
            high - sum((1e3 * (x / p - 1.0)) ** 2 for x, p in zip(numbers, peak))
            for high, *peak in self.peaks
        )

    def scan(self, spec, theta, kind, points):
        self.scans.append((spec, dict(theta), points))
        return np.array([self.height(p[: len(NAMES[kind])]) for p in points])

    def at(self, spec, theta):
        numbers = [theta[m] for m in NAMES.get(spec.valve, ()) if m in theta]
        return Fit(
            spec, self.height(numbers) if numbers else 0.0, dict(theta), np.ones(3), np.zeros(3)
        )

    def fit(self, spec, theta, search=None, steps=10):
        self.fits.append((search, steps))
        return self.at(spec, theta)


@pytest.mark.parametrize(
    ("kind", "peak"),
    [
        (kernels.PLAY, (5.0,)),
        (kernels.STICK, (5.0, 2.0)),
        (kernels.CREEP, (5.0, 2.0)),
        (kernels.ZONE, (5.0, 50.0)),
    ],
)
@pytest.mark.parametrize("off", [0.93, 1.0, 1.08])
def test_a_peak_is_followed_to_a_thousandth(kind, peak, off):
    engine = Peaks(kind, (0.0, *peak))
    first = fit_with_map(
        engine, Spec(), THETA, kind, np.array([off * peak[0], *peak[1:], 0.0, 0.0])[:3]
    )
    best = narrow(engine, first)
    assert [best.theta[m] for m in NAMES[kind]] == pytest.approx(peak, rel=1e-3)


def test_the_higher_of_two_peaks_wins_though_a_coarse_scan_puts_it_second():
    # 2 % off a low broad looking one, 3 % off a high one
    engine = Peaks(kernels.PLAY, (0.0, 4.0), (300.0, 9.0))
    points = np.array([(4.08, 0.0, 0.0), (9.27, 0.0, 0.0), (9.3, 0.0, 0.0)])
    best = scan_map(engine, Spec(), THETA, kernels.PLAY, points)
    assert best.theta["S"] == pytest.approx(9.0, rel=0.011)
    # points nearer than the width of a peak count as one
    near = engine.scans[1][2][:, 0]
    assert (near.min(), near.max()) == pytest.approx((4.08 * 0.96, 9.27 * 1.04))
    assert not np.any((near > 4.5) & (near < 8.8))
