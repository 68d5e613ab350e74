"""Compute the likelihood of a record for all effects between OP and PV by a Kalman filter; the
other parameters of the loop are fitted at the same time.

PV = plant(valve(OP)) + load + noise. The plant's gain, the bias and every additive regressor are
linear in the innovations and solved by least squares; only T, Td, the load's colour and level, the
noise level and the numbers of the effect are searched. Time unit is one sample, PV in its units.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.model import (
    HOLDING,
    REDDEST,
    Data,
    Fit,
    Spec,
    before_filter,
    jumps_of,
    lag_of,
    load_std,
    valve_of,
)
from simbench.gap.thresholds import NOMINAL

_EDGE = 0.02  # standard deviation with which the prior falls off beyond `NOMINAL`
# the same for its noise: few know it better, and the least that four simulators draw as another
# noise is 1.4 times the stated one; with .1 healthy records of two of them were called noisy
_NOISE = 0.25
_NOISE_MEASURED = 0.1  # the same where healthy records show it
_LOAD_EDGE = 0.15  # standard deviation of the logarithm of a load beyond those of healthy records
# multiples of a baseline's gain between which another one is looked for (four simulators draw .25
# to 4): below, a load explains all and the valve nothing, as it can in any loop at rest
_MISMATCH = (0.2, 10.0)
_LOGS = {"T", "load_time", "load_lag", "load", "noise_std"}
_SHAPING = {"T", "Td"}  # nuisances that change signals, not only the noise model
_QUICK = 0.08  # share of the longest memory a load may have: below it the prior ...
_QUICKER = 0.7  # ... falls off with this standard deviation of the logarithm
STEP = 1e-4  # step of a parameter or its logarithm, for derivatives
# the same about a noise correlation of 0, below half of which the filter takes noise for white
_WHITE = 0.02
_LONGEST = 1.5  # largest change of a parameter or its logarithm in one step
_IDLE = 1e-3  # curvature added to every parameter
_LAST_STEP_NATS = 0.01  # nats below which a step is the last
_COLOURED = 0.5  # std of the prior on the noise's correlation from sample to sample


class Engine:
    """Evaluates and maximises the likelihood for one record."""

    def __init__(self, data: Data, longest_load: float) -> None:
        self.data = data
        self.longest_load = longest_load
        n = data.n
        k = np.arange(n) / n
        if data.T > 0:
            self.base_channels = (np.ones(n),)
        else:
            self.base_channels = (k,)
        self.onset = np.ones(n)
        self.onset[0] = 0.0
        self.spread = 10.0 * float(np.std(data.y)) + data.floor

    def start(self) -> dict[str, float]:
        """Return the nuisance parameters from which the first fit starts."""
        # The noise that is stated, or what second differences show
        d = self.data
        rough = float(np.std(np.diff(d.y, 2))) / np.sqrt(6.0)
        if d.noise > 0:
            noise = d.noise
        else:
            noise = max(rough, d.floor)

        # A load as large as PV, or as its steps
        if d.T > 0:
            load = max(float(np.std(d.y)), noise)
        else:
            load = max(float(np.std(np.diff(d.y))), 0.1 * noise)

        # Numbers to start from, in samples
        return {
            "T": d.T,
            "Td": d.Td,
            "load_time": 0.3 * self.longest_load,
            "load_lag": 0.2,
            "load": 0.5 * load,
            "noise_std": max(noise, d.floor),
            "colour": 0.1,
        }

    def base(self) -> Fit:
        """Return the fit without effect: with a first-order, a smooth, or a 1/f load."""
        first = self.fit(Spec(), self.start(), steps=20)
        smooth = {**first.theta, "load_lag": max(0.5 * first.theta["load_time"], 0.5)}
        pink = {**first.theta, "load_time": 0.7 * self.longest_load}
        tries = [
            first,
            self.fit(Spec(), smooth, steps=20),
            self.fit(Spec(pink=True), pink, steps=20),
        ]
        best = max(tries, key=lambda f: f.loglik)

        # whole samples of dead time part the likelihood into valleys
        ends = [self.data.Td * (1.0 + NOMINAL * side) for side in (-1, 1)]
        tries = []
        for Td in ends:
            if abs(Td - best.theta["Td"]) > 0.25:
                tries.append(self.fit(best.spec, {**best.theta, "Td": Td}))
        return max([best] + tries, key=lambda f: f.loglik)

    def bounds(self, spec: Spec, name: str) -> tuple[float, float]:
        """Return the search interval of one parameter."""
        # A number of an effect has its own bounds
        d = self.data
        for number in spec.effect_numbers:
            if number.name == name:
                return number.low(d), number.high(d)

        # The plant: wide where it is not trusted or free
        if name == "T" and not d.trusted:
            # a plant slower than the record shows is an integrator, and was not asked for
            return 0.05, max(d.n / 15.0, d.T)
        if name == "T":
            wide = 20.0 if "T" in spec.free else 1.25
            return d.T / wide, d.T * wide
        if name == "Td":
            if "Td" in spec.free or not d.trusted:
                wide = 5.0 + max(3.0 * d.Td, 2.0 * d.T)
            else:
                wide = 0.25 * d.Td + 0.5 + d.late
            return max(d.Td - wide, 0.0), min(d.Td + wide, d.n / 4)

        # Load and noise
        return {
            "load_time": (0.3, self.longest_load),
            "load_lag": (0.05, self.longest_load),
            "load": (1e-3 * d.floor if d.T > 0 else 1e-8 * d.size, 100.0 * d.size),
            "noise_std": (d.floor, 10.0 * d.size),
            "colour": (-REDDEST, REDDEST),
        }[name]

    def evaluate(self, spec: Spec, theta: Mapping[str, float]) -> float:
        """Return the penalised log-likelihood."""
        return self.at(spec, theta).loglik

    def _likelihood_terms(
        self, spec: Spec, theta: Mapping[str, float]
    ) -> tuple[np.ndarray, float, np.ndarray, np.ndarray, np.ndarray]:
        """Return what the likelihood is made of: -log-likelihood = |left|^2 / 2 + level.

        `left` holds the innovations, then the priors' residuals; `level` the log variances; further
        the linear coefficients, the whitened and the raw channels (PV first).
        """
        channels = self._input_channels(spec, theta)
        white, level = self._whiten_channels(spec, theta, channels)
        used = white[:, kernels.SKIP :]
        beta, surprise = self._fit_linear(spec, used @ used.T)
        residual = used[0] - beta @ used[1:]
        left = np.concatenate([residual, [surprise], self._prior_distances(spec, theta)])
        return left, level, beta, white, channels

    def _input_channels(self, spec: Spec, theta: Mapping[str, float]) -> np.ndarray:
        """Return PV as deviation from its start, the plant's answer to MV, and every other signal
        that enters linearly.
        """
        # The plant's pole, and the sensor's where it has one
        d = self.data
        if d.T > 0:
            T = theta["T"]
        else:
            T = 0.0
        y = d.y
        if spec.pole:
            tau = theta.get("tau", 0.0)
        else:
            tau = 0.0
        if spec.pole == "sensor":
            y = before_filter(y, tau)
            tau = 0.0
        moved = d.shaped(valve_of(spec, theta, d.u))

        # the input before the record may have stood elsewhere
        inputs = [moved, d.shaped(self.onset)]
        if spec.valve in HOLDING:
            # and a valve that holds may stand anywhere in its band until it first moves
            inputs.append(d.shaped((moved == moved[0]).cumprod().astype(float)))
        g, *begin = kernels.plants(np.array(inputs), T, theta["Td"], tau)
        return np.array([y - d.y[0], g] + list(self.base_channels) + begin + list(spec.channels))

    def _whiten_channels(
        self, spec: Spec, theta: Mapping[str, float], channels: np.ndarray
    ) -> tuple[np.ndarray, float]:
        """Return the channels' innovations over their standard deviation, and the part of
        -log-likelihood that is no square.
        """
        model = self.noise_model(spec, theta)
        jumps = jumps_of(spec, theta)
        white, log_var = kernels.whiten(channels, model, jumps)
        count = self.data.n - kernels.SKIP
        jacobian = 0.0
        if spec.pole == "sensor":
            jacobian = count * math.log(-math.expm1(-1.0 / theta["tau"]))
        return white, 0.5 * (log_var + count * math.log(2 * math.pi)) + jacobian

    def noise_model(self, spec: Spec, theta: Mapping[str, float]) -> kernels.NoiseModel:
        """Return what moves PV besides the plant's input."""
        return kernels.NoiseModel(
            theta["T"] if self.data.T > 0 else 0.0,
            theta["tau"] if spec.pole == "extra" else 0.0,
            theta["load_time"],
            lag_of(theta),
            theta["load"],
            theta["noise_std"],
            theta["colour"],
            self.spread,
            theta["load_walk"] if spec.load_walk else 0.0,
            theta["walk"] if spec.walk else 0.0,
        )

    def _fit_linear(self, spec: Spec, N: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the linear coefficients and how far, in standard deviations, the gain lies outside
        its prior.
        """
        # The least squares of the channels
        A = _regularise(N[1:, 1:])
        b = N[1:, 0].copy()
        beta = np.linalg.solve(A, b)

        # A gain far from a trusted one is drawn to its edge
        K = self.data.K
        low, high = self._gain_limits(spec)
        if not self.data.trusted or low <= beta[0] <= high:
            return beta, 0.0
        edge = low if beta[0] < low else high
        weight = 1.0 / (_EDGE * K) ** 2
        A[0, 0] += weight
        b[0] += weight * edge
        beta = np.linalg.solve(A, b)
        return beta, float((beta[0] - edge) / (_EDGE * K))

    def _gain_limits(self, spec: Spec) -> tuple[float, float]:
        """Return the smallest and the largest gain that the plant may have."""
        least = 1.0 - NOMINAL
        most = 1.0 + NOMINAL
        if not self.data.trusted:
            least = 0.05
            most = 20.0
        elif "K" in spec.free:
            least, most = _MISMATCH
        low, high = sorted((self.data.K * least, self.data.K * most))
        return low, high

    def _prior_distances(self, spec: Spec, theta: Mapping[str, float]) -> list[float]:
        """Return how far, in standard deviations, each parameter lies outside its prior."""
        d = self.data
        out = [theta["colour"] / _COLOURED]
        if d.trusted:
            # what moves much quicker than the loop never gets through the plant: such a "load" is
            # something else
            memory = theta["load_time"] + theta.get("load_lag", 0.0)
            out.append(min(np.log(memory / (_QUICK * self.longest_load)), 0.0) / _QUICKER)
            if d.T > 0 and "T" not in spec.free:
                out.append(_excess_over(np.log(theta["T"] / d.T), np.log1p(NOMINAL), _EDGE))
            if "Td" not in spec.free:
                # an archive that lags by a sample hides one sample of dead time
                wide = NOMINAL * d.Td + d.late / 2 + 0.05
                out.append(_excess_over(theta["Td"] - d.Td + d.late / 2, wide, _EDGE * d.Td + 0.03))
        if d.measured:
            out.append(max(np.log(load_std(theta) / d.most_load), 0.0) / _LOAD_EDGE)
        if d.noise > 0 and "noise_std" not in spec.free:
            # what rounding adds to the stated noise is no effect
            stated = np.hypot(d.noise, d.resolution / np.sqrt(12.0))
            within = _NOISE_MEASURED if d.measured else _NOISE
            out.append(_excess_over(np.log(theta["noise_std"] / stated), np.log1p(within), _EDGE))
        return out

    def fit(
        self,
        spec: Spec,
        start: Mapping[str, float],
        search: tuple[str, ...] | None = None,
        steps: int = 10,
    ) -> Fit:
        """Maximise over the smooth parameters named in `search` (all of the spec's when None), from
        `start`.

        Fisher scoring (Gupta & Mehra 1974) with Levenberg's damping: the derivatives of the
        innovations give the curvature, so a handful of steps does what a general optimiser needs
        dozens for.
        """
        # What is searched, in logarithms where it spans decades
        wanted = [m for m in search or spec.names if m in spec.names]
        names = tuple(m for m in wanted if m != "T" or self.data.T > 0)
        theta = {}
        for m in spec.names:
            if m in start or m in names:
                theta[m] = start[m]
        logs, box, unpack = self._search_space(spec, names, theta)
        box[:, 1] = np.maximum(box[:, 0], box[:, 1])
        x = np.array([theta.get(m, 0.0) for m in names])
        x[logs] = np.log(np.maximum(x[logs], 1e-300))
        x = np.clip(x, box[:, 0], box[:, 1])

        # Steps of Levenberg and Marquardt, within the box
        now = self._likelihood_terms(spec, unpack(x))
        value = 0.5 * float(now[0] @ now[0]) + now[1]
        damping = 1e-2
        for _ in range(steps):
            J, slope = self._differentiate_terms(spec, names, x, box, unpack, now)
            gradient = J @ now[0] + slope
            curvature = self._curvature_of(now, J, slope)
            free = ~(((x <= box[:, 0]) & (gradient > 0)) | ((x >= box[:, 1]) & (gradient < 0)))
            gained = 0.0
            for _ in range(6):
                if not free.any():
                    break
                H = curvature[np.ix_(free, free)]
                # the last term holds a parameter that does nothing here, lest rounding drives it
                H = H + damping * np.diag(np.diag(H)) + _IDLE * np.eye(len(H))
                trial = x.copy()
                trial[free] -= np.clip(np.linalg.solve(H, gradient[free]), -_LONGEST, _LONGEST)
                trial = np.clip(trial, box[:, 0], box[:, 1])
                then = self._likelihood_terms(spec, unpack(trial))
                new = 0.5 * float(then[0] @ then[0]) + then[1]
                if new < value:
                    gained = value - new
                    x = trial
                    value = new
                    now = then
                    damping = max(0.1 * damping, 1e-6)
                    break
                damping *= 10.0
            if gained < _LAST_STEP_NATS:
                break
        return _make_fit(spec, unpack(x), now)

    def _search_space(
        self, spec: Spec, names: tuple[str, ...], theta: Mapping[str, float]
    ) -> tuple[np.ndarray, np.ndarray, Callable[[np.ndarray], dict[str, float]]]:
        """Return which parameters are searched by their logarithm (p,), their bounds (p, 2), and
        what turns a point of the search into all parameters.
        """
        by_log = _LOGS | {number.name for number in spec.effect_numbers if number.log}
        logs = np.array([m in by_log for m in names])
        box = np.array([self.bounds(spec, m) for m in names])
        box[logs] = np.log(box[logs])

        def unpack(x: np.ndarray) -> dict[str, float]:
            values = np.where(logs, np.exp(np.where(logs, x, 0.0)), x)
            return {**theta, **{m: float(v) for m, v in zip(names, values)}}

        return logs, box, unpack

    def _differentiate_terms(
        self,
        spec: Spec,
        names: tuple[str, ...],
        x: np.ndarray,
        box: np.ndarray,
        unpack: Callable,
        now: tuple,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives of `left` (p, n) and `level` (p,), with the linear
        coefficients held, see `_likelihood_terms`.
        """
        # The error of PV with the linear coefficients held
        left, level, beta, _, channels = now
        error = channels[0] - beta @ channels[1:]
        J = np.empty((x.size, left.size))
        slope = np.empty(x.size)
        shaping = _SHAPING | {number.name for number in spec.effect_numbers if number.shapes}
        count = self.data.n - kernels.SKIP

        # One number after the other, by a one-sided step within its box
        for i, name in enumerate(names):
            step = _WHITE if name == "colour" and abs(x[i]) < _WHITE else STEP
            h = step if x[i] + step <= box[i, 1] else -step
            moved = x.copy()
            moved[i] += h

            # Only numbers that shape a signal make the signals anew
            theta = unpack(moved)
            changed = error
            if name in shaping:
                signals = self._input_channels(spec, theta)
                changed = signals[0] - beta @ signals[1:]

            # Residuals, then how far each number lies outside its prior
            white, higher = self._whiten_channels(spec, theta, changed[None, :])
            J[i, :count] = white[0, kernels.SKIP :]
            J[i, count] = left[count]
            J[i, count + 1 :] = self._prior_distances(spec, theta)
            J[i] -= left
            J[i] /= h
            slope[i] = (higher - level) / h
        return J, slope

    def _curvature_of(self, now: tuple, J: np.ndarray, slope: np.ndarray) -> np.ndarray:
        """Return the likelihood's curvature (p, p) from the derivatives of its terms."""
        J = self._without_linear(now, J)
        return J @ J.T + (2.0 / self.data.n) * np.outer(slope, slope)

    def _without_linear(self, now: tuple, J: np.ndarray) -> np.ndarray:
        """Return derivatives less what the linear coefficients, fitted anew, would take back (Golub
        & Pereyra 1973).
        """
        left, _, _, white, _ = now
        count = white.shape[1] - kernels.SKIP
        X = np.zeros((white.shape[0] - 1, left.size))
        X[:, :count] = white[1:, kernels.SKIP :]
        if left[count] != 0.0:
            # the gain lies at the edge of its prior, which holds it
            X[0, count] = -1.0 / (_EDGE * self.data.K)
        return J - np.linalg.solve(_regularise(X @ X.T), X @ J.T).T @ X

    def at(self, spec: Spec, theta: Mapping[str, float]) -> Fit:
        """Return the fit at given nonlinear parameters."""
        return _make_fit(spec, dict(theta), self._likelihood_terms(spec, theta))

    def scan(
        self, spec: Spec, theta: Mapping[str, float], kind: int, points: np.ndarray
    ) -> np.ndarray:
        """Return the log-likelihood, without the priors, of many valve maps with all else held; a
        fine grid costs little.
        """
        gy, gg, level = self._scan_maps(spec, theta, kind, points)
        low, high = self._gain_limits(spec)
        seen = gg > 1e-12
        K = np.where(seen, np.clip(gy / np.where(seen, gg, 1.0), low, high), 0.0)
        return K * gy - 0.5 * K * K * gg - level

    def _scan_maps(
        self, spec: Spec, theta: Mapping[str, float], kind: int, points: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Return, of many valve maps, the plant's answer times PV and times itself, whitened, and
        -log-likelihood where the plant answers nothing.
        """
        d = self.data

        # a plant of higher order is near enough as a later one: the best is fitted as it is
        model = self.noise_model(spec, theta)
        Td = theta["Td"] + d.lateness

        # a scan ranks maps without the walks
        model = model._replace(load_walk=0.0, walk=0.0)
        onset = kernels.plant(self.onset, model.T, Td, model.tau)
        channels = np.vstack(
            [d.y - d.y[0]] + list(self.base_channels) + [onset] + list(spec.channels)
        )
        jumps = jumps_of(spec, theta)
        white, log_var = kernels.whiten(channels, model, jumps)
        white[:, : kernels.SKIP] = 0.0
        basis = np.ascontiguousarray(np.linalg.qr(white[1:].T)[0].T)
        rest = white[0] - basis.T @ (basis @ white[0])
        count = d.n - kernels.SKIP
        level = 0.5 * (float(rest @ rest) + log_var + count * np.log(2 * np.pi))
        return kernels.scan(d.u, kind, points, Td, model, rest, basis, jumps) + (level,)

    def grid(
        self, spec: Spec, theta: Mapping[str, float], points: list[dict[str, float]], keep: int = 1
    ) -> list[Fit]:
        """Return the best of some points, each with two levels of the load: the one "none" needed
        may hide a narrow peak.
        """
        trials = []
        for share in (1.0, 0.3):
            for point in points:
                trials.append({**theta, **point, "load": theta["load"] * share})
        fits = [self.at(spec, trial) for trial in trials]
        return sorted(fits, key=lambda fit: -fit.loglik)[:keep]


def _make_fit(spec: Spec, theta: dict[str, float], terms: tuple) -> Fit:
    """Return the fit whose likelihood is made of some terms, see `Engine._likelihood_terms`."""
    left, level, beta, white, _ = terms
    loglik = -0.5 * float(left @ left) - level
    return Fit(spec, loglik, theta, beta, white[0] - beta @ white[1:])


def _regularise(squares: np.ndarray) -> np.ndarray:
    """Return products of channels (m, m) that a channel that does nothing (no step yet, a zone
    never met) does not make singular.
    """
    out = squares.copy()
    out.flat[:: len(out) + 1] += 1e-12 * float(np.trace(out)) + 1e-300
    return out


def _excess_over(x: float, width: float, edge: float) -> float:
    return max(abs(x) - width, 0.0) / edge
