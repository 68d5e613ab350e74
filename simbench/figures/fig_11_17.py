"""Figure 11.17: how a sine and a triangle are fitted to each half cycle between two zero crossings.

The half cycles are OP of a simulated sticky loop with measurement noise.
"""

import pandas as pd
from matplotlib.figure import Figure

from simbench.detectors.errors import ParameterError
from simbench.detectors.signal.conditioning import band
from simbench.figures._fits import eta, half_cycle_fits
from simbench.figures._loops import Loops
from simbench.figures._marks import note
from simbench.loop.simulate import simulate
from simbench.page.style import BLACK, BLUE, GREY, RED, label, panels, styled
from simbench.scenarios.spec import Loop
from simbench.theory.cycle import exact_cycle
from simbench.theory.sampled import sampled_loop

SOURCE = "Jelali (2013), Fig. 11.17, after He et al. (2007)"
NUMBERS = {"T": 10.0, "Td": 5.0, "Kc": 1.0, "Ti": 10.0, "Ts": 1.0, "S": 5.0, "J": 3.0}


def loop(loops: Loops | None = None) -> Loop:
    """Return the noisy sticky loop."""
    setpoint = {"value": 50.0, "steps": [[0.0, 54.0]]}
    return (loops or Loops()).pi(numbers=NUMBERS, n=1200, noise={"std": 0.08}, setpoint=setpoint)


def data(loops: Loops | None = None) -> pd.DataFrame:
    """Simulate the loop and fit two periods of OP.

    Columns: half (number), sample (= s), signal, sine, triangle (% of travel, mean removed), and
    the numbers of the loop.
    """
    loops = loops or Loops()
    sticky = loop(loops)
    exact = exact_cycle(sampled_loop(sticky))
    if exact is None:
        raise ParameterError(
            "figure fig-11-17: this loop has no limit cycle, whose halves are drawn"
        )
    period = exact.period / sticky.sampling.Ts
    op = band(simulate(sticky, seed=1).record.op[600:], period, 7)
    fits = half_cycle_fits(op, period)
    return fits.query("4 <= half < 8").reset_index(drop=True).assign(**loops.last)


@styled
def draw(data: pd.DataFrame) -> Figure:
    """Draw the sine fits above the triangle fits."""
    # Each kind of fit over the same half cycles
    figure, axes = panels(2, 1, 6.2, 4.8, sharex=True)
    start = data["sample"].min()
    for place, (name, colour) in zip(axes[:, 0], (("sine", BLUE), ("triangle", RED))):
        for _, part in data.groupby("half"):
            t = part["sample"] - start
            place.plot(t, part["signal"], ".", color=BLACK, markersize=3)
            place.plot(t, part[name], color=colour, linewidth=1.5)
            place.axvline(t.iloc[0], color=GREY, linewidth=0.6, linestyle=":")
        place.axhline(0, color=GREY, linewidth=0.6)
        mse = float(((data["signal"] - data[name]) ** 2).mean())
        label(
            place,
            "time (s)",
            "OP - mean (%)",
            f"({'a' if name == 'sine' else 'b'}) {name} fit: mean squared error {mse:.3f} %²",
        )
        place.label_outer()

    # The index of both errors
    note(axes[1, 0], f"η = {eta(data):.2f}", 0.98, 0.98, "right")
    return figure
