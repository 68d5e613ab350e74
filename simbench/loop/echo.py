"""A load under which a loop with a sound valve moves like the same loop with a sticky one, but for
the corners of the valve's motion; `valve` is the model of the sticky one, whose parameters stand
beside it.

Sample by sample, a loop whose valve sticks is the loop without friction under one load more at the
plant's input, the valve's error MV - OP. The donor is the loop itself with a sticky valve and the
same seed; its error with everything above `cut` times the cycle's frequency taken off is the load.
Amplitude, period, wandering, growth and noise of the healthy record are then those of a sticky one,
and only the shape of the waves differs.
"""

from __future__ import annotations

import math

import numpy as np

from simbench.detectors.errors import ParameterError, UserError
from simbench.detectors.signal.autocorrelation import fast_size
from simbench.detectors.signal.filters import lfilter
from simbench.loop.elementary import elementwise
from simbench.loop.motion import MIN_REVERSALS, least_swing, motion
from simbench.loop.parameters import VALVES, Choice, Number, resolve
from simbench.loop.response import stages_response
from simbench.loop.run import signals_of
from simbench.loop.setup import Setup, stages_of
from simbench.scenarios.cell import ECHOES
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop

NAME = "echo"
SHAPES = {
    "kind": Choice(
        ECHOES,
        default="smooth",
        says="what takes the place of the corners: nothing; harmonics of a load that is no sine; or"
        " the corners of another valve, behind a lag",
    ),
    "cut": Number(
        "cycle's frequency",
        low=0.0,
        default=1.7,
        positive=True,
        says="frequency above which nothing of the valve's error is left",
    ),
}
VALVE = "valve"
_FUNDAMENTAL = (0.6, 1.6)  # band about the cycle's frequency
_HARMONICS = {2: 0.15, 3: 0.3, 5: 0.12}  # largest share of the fundamental that is drawn
# of the other valve
_LAG = (0.1, 0.3)  # periods
_SIZE = (0.3, 1.0)  # over this valve's motion
_SHORTEST = 4.0  # samples per period; a shorter cycle has no shape
_SETTLING = 3  # the first of so many parts of a run is left out, where its period is measured
_PADDED = 3.0  # periods by which the error is continued at both ends, mirrored


class NoCycleError(ParameterError):
    """The loop with the sticky valve has no oscillation that could be echoed."""


def donor_of(loop: Loop, echo: Part) -> Loop:
    """Return the loop whose valve's error a load is: without the load, and with its valve."""
    # An echo comes last, and once
    if loop.disturbance[-1] is not echo or any(d.name == NAME for d in loop.disturbance[:-1]):
        raise ParameterError(
            f"disturbance {NAME!r} is followed by another one; it must be the last, and the only"
            " echo"
        )

    # The sticky valve that it echoes
    name = echo.parameters.get(VALVE)
    if not isinstance(name, str):
        raise ParameterError(
            f"disturbance {NAME!r}: valve = {name!r}; the model of the sticky valve is needed, with"
            " its parameters beside it"
        )
    numbers = {}
    for k, v in echo.parameters.items():
        if k not in (*SHAPES, VALVE):
            numbers[k] = v

    # The valve must be one that can be built
    valve = Part(name=name, parameters=numbers)
    VALVES.load(name)
    try:
        stages_of(valve, loop.sampling.Ts)
    except UserError as error:
        raise ParameterError(f"disturbance {NAME!r}: {error}") from None

    # The loop with that valve in place of the echo
    return loop.model_copy(update={"disturbance": loop.disturbance[:-1], "valve": valve})


def echo_load(echo: Part, donor: Setup, own: Setup, stream: tuple[int, ...]) -> np.ndarray:
    """Return the load (%) of shape (warm_up + n,): the donor's valve's error without its corners,
    where `own` is the loop that it acts on.
    """
    # What the sticky valve does, less what its loop's other stages do
    given = {}
    for k, v in echo.parameters.items():
        if k in SHAPES:
            given[k] = v
    p = resolve(SHAPES, given, f"disturbance {NAME!r}")
    op, _, mv = signals_of(donor)
    error = mv - stages_response(tuple(own.valves), op, donor.op0)

    # of warm-up and record together: a record that begins earlier must have the same load
    moved = motion(mv[mv.size // _SETTLING :], least_swing(donor.bands) / 4.0)
    period = moved.period
    if moved.reversals < MIN_REVERSALS or period < _SHORTEST:
        raise NoCycleError(
            f"disturbance {NAME!r}: the loop with valve {echo.parameters[VALVE]!r} does not cycle;"
            f" three periods of at least {_SHORTEST:g} samples are needed"
        )

    # Its slow part, and the kind of echo that is asked for
    rng = np.random.default_rng(stream)
    kind = ECHOES[int(p.kind)]
    load = _low_pass(error, p.cut / period, period)
    if kind == "harmonics":
        load += _draw_harmonics(error, period, rng)
    elif kind == "propagated":
        load += _other_corners(mv, p.cut / period, period, rng)
    return load


def _draw_harmonics(error: np.ndarray, period: float, rng: np.random.Generator) -> np.ndarray:
    """Return harmonics that follow the phase and the size of the error's fundamental."""
    # The error's fundamental, between two low-pass filters
    low, high = (share / period for share in _FUNDAMENTAL)
    band = _low_pass(error, high, period) - _low_pass(error, low, period)

    # Its analytic signal: size and phase
    spectrum = np.fft.fft(band)
    spectrum[1 : (band.size + 1) // 2] *= 2.0
    spectrum[band.size // 2 + 1 :] = 0.0
    analytic = np.fft.ifft(spectrum)
    size = elementwise(math.hypot, analytic.real, analytic.imag)
    phase = np.unwrap(elementwise(math.atan2, analytic.imag, analytic.real))

    # Each harmonic follows both, with a share and a turn that are drawn
    total = np.zeros(error.size)
    for times, most in _HARMONICS.items():
        share = rng.uniform(0.0, most)
        turned = rng.uniform(0.0, 2.0 * math.pi)
        if times / period < 0.5:  # above, it would be another frequency once sampled
            total += share * size * elementwise(math.cos, times * phase + turned)
    return total


def _other_corners(
    mv: np.ndarray, cut: float, period: float, rng: np.random.Generator
) -> np.ndarray:
    """Return what is fast in the motion of a valve elsewhere in the plant, behind a lag."""
    lag = period * math.exp(rng.uniform(*map(math.log, _LAG)))
    size = rng.uniform(*_SIZE) * rng.choice((-1.0, 1.0))
    keep = math.exp(-1.0 / lag)
    moved = np.asarray(lfilter([1.0 - keep], [1.0, -keep], mv - mv[0]))
    return size * (moved - _low_pass(moved, cut, period))


def _low_pass(x: np.ndarray, cut: float, period: float) -> np.ndarray:
    """Return what of a signal is slower than `cut` (cycles per sample), without delay, as a
    Butterworth filter of order 6 forwards and backwards gives it: 1/(1 + (f/cut)^12) of it.
    """
    more = min(math.ceil(_PADDED * period), x.size - 1)
    ends = 2.0 * x[0] - x[more:0:-1], 2.0 * x[-1] - x[-2 : -more - 2 : -1]
    size = fast_size(x.size + 2 * more)
    padded = np.concatenate([ends[0], x, ends[1]])
    padded = np.concatenate([padded, np.linspace(padded[-1], padded[0], size - padded.size)])
    square = (np.fft.rfftfreq(size) / cut) ** 2
    fourth = square * square
    gain = 1.0 / (1.0 + fourth * fourth * fourth)
    spectrum = np.fft.rfft(padded)

    # parts apart: a product of complex numbers is rounded once or twice, as the processor has it
    spectrum.real *= gain
    spectrum.imag *= gain
    return np.fft.irfft(spectrum, size)[more : more + x.size]
