"""Draw the cross-correlation of OP and PV near lag 0, with the points that Horch's method uses."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from simbench.detectors.methods.horch import correlation_indices
from simbench.page.style import BLUE, GREY, label


@dataclass(frozen=True)
class _Marks:
    """Zero crossings (s, both positive), values at lag 0 and at the peak between them (-), and the
    two indices (-).
    """

    tau_l: float
    tau_r: float
    phi_0: float
    phi_max: float
    dtau: float
    drho: float

    def __str__(self) -> str:
        return f"Δτ = {self.dtau:.2f}, Δρ = {self.drho:.2f}"


def correlation(op: np.ndarray, pv: np.ndarray, Ts: float, reach: float) -> pd.DataFrame:
    """Return the cross-correlation Phi(tau) = sum (PV(t + tau) - mean)(OP(t) - mean), scaled to
    -1..1.

    Horch (1999), Eqs 11.6 to 11.8 of the chapter; summed directly here, by FFT in the detector.
    """
    u = op - op.mean()
    y = pv - pv.mean()
    lags = np.arange(-round(reach / Ts), round(reach / Ts) + 1)
    n = u.size
    phi = [float(y[max(k, 0) : n + min(k, 0)] @ u[max(-k, 0) : n - max(k, 0)]) for k in lags]
    dtau, drho = correlation_indices(op, pv)
    scale = n * u.std() * y.std()
    return pd.DataFrame(
        {"lag (s)": lags * Ts, "Phi (-)": np.array(phi) / scale, "dtau (-)": dtau, "drho (-)": drho}
    )


def marks(table: pd.DataFrame) -> _Marks:
    """Find Horch's points on a drawn cross-correlation."""
    # The crossings on either side of lag 0, interpolated
    lag = table["lag (s)"].to_numpy()
    phi = table["Phi (-)"].to_numpy()
    zero = int(np.argmin(np.abs(lag)))
    crossing = []
    for side in (-1, 1):
        k = zero
        while phi[k] * phi[k + side] > 0:
            k += side
        crossing.append(abs(lag[k] + (lag[k + side] - lag[k]) * phi[k] / (phi[k] - phi[k + side])))

    # The extreme between them
    near = phi[(lag >= -crossing[0]) & (lag <= crossing[1])]
    top = float(np.sign(phi[zero]) * np.abs(near).max())
    tau_l, tau_r = map(float, crossing)

    # Horch's two differences
    now = float(phi[zero])
    dtau = abs(tau_l - tau_r) / (tau_l + tau_r)
    drho = abs(now - top) / abs(now + top)
    return _Marks(tau_l, tau_r, now, top, dtau, drho)


def draw_correlation(axes: Axes, table: pd.DataFrame, title: str) -> _Marks:
    """Draw a cross-correlation with its zero crossings and its values at lag 0 and at the peak."""
    points = marks(table)
    axes.axhline(0, color=GREY, linewidth=0.6)
    axes.axvline(0, color=GREY, linewidth=0.6)
    axes.plot(table["lag (s)"], table["Phi (-)"], color=BLUE)
    axes.plot(
        [-points.tau_l, points.tau_r], [0, 0], "o", color="black", markerfacecolor="white", zorder=4
    )
    axes.plot([0], [points.phi_0], "ko", zorder=4)
    label(axes, "lag τ (s)", "cross-correlation Φ (-)", title)
    return points
