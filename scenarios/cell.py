"""One cell of a ruled grid: settings without dimension become a sticky loop, its siblings, and the
rules left to settle.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

from simbench.scenarios.errors import SpecError, suggestion
from simbench.scenarios.plant import Value
from simbench.scenarios.spec import Loop
from simbench.scenarios.toml import content_hash

SETTINGS = {
    "process": "foptd or integrating",
    "controller": "PI or P",
    "Td_over_T": "dead time over time constant (foptd)",
    "Td_over_Ti": "dead time over integral time (integrating)",
    "S_over_2J": "S/(2J): 0.5 = J as large as S, inf = dead-band",
    "noise_ratio": "noise std over the PV std of the sticky twin without noise",
    "disturbance": "none, or a name of [disturbances]",
    "tuning": "slow, medium, tight, or of a healthy loop aggressive or saturating",
    "samples_per_period": "samples per period of the sticky twin",
    "periods": "length of the record in periods of the loop's oscillation",
    "warm_up": "length of what is simulated before the record begins, in these periods",
    "K": "plant gain (PV units per %; integrating: per % and T)",
    "T": "time scale (s): T of foptd, Ti of an integrating loop",
    "S": "stick band plus dead-band (% of travel)",
    "pv_rest": "set point before the excitation (PV units)",
    "op_rest": "OP with which the loop rests (%)",
    "step": "size of the excitation at the start of the run, in S",
    "speed": "factor on the tuning's speed",
    "excitation": "setpoint, load or both, at time 0",
    "w_Ti": "2 pi Ti over the period of the cycle; Ti is chosen for it",
    "effect": "none, or a name of [effects]: what happens to the loop or its record besides",
    "mv_noise": "noise std on the recorded MV, in S",
    "moves": "set-point steps over the record, a number",
    "move": "largest level of these steps about the first, in PV std of the sticky twin",
    "cut": "of an echo: where it ends, as a multiple of the frequency of the sticky loop's cycle",
}
# settings that are words; all others are numbers
TAG_WORDS = ("process", "controller", "disturbance", "tuning", "excitation", "effect")
# closed-loop time constant over dead time (foptd), gain over that of double poles (integrating),
# share of the ultimate gain (P)
FOPTD_LAG = {"slow": 3.0, "medium": 1.5, "tight": 0.8}
_INTEGRATING_GAIN = {"slow": 0.6, "medium": 1.0, "tight": 1.5}
_P_SHARE = {"slow": 0.15, "medium": 0.35, "tight": 0.6}
# of a healthy loop that oscillates by its own tuning: gain over the ultimate gain of the sampled
# loop
ULTIMATE = {"aggressive": 0.9, "saturating": 1.5}
SAME = "same"
ECHOES = ("smooth", "harmonics", "propagated")  # kinds of the load `echo`
EXCITATIONS = ("setpoint", "load", "both")
# tags that say which scenario of which grid is asked for
_IDENTITY = ("benchmark", "block", "member", "cell", "repeat", "echo")
_REST = 50.0  # SP, PV and OP before the excitation


@dataclass(frozen=True)
class Rules:
    """What one noise-free run of the sticky twin settles; None = the loop's own numbers stand."""

    # samples_per_period, periods: sampling of the whole group
    samples_per_period: float | None = None
    periods: float | None = None
    noise_ratio: float | None = None  # noise std over the twin's PV std
    w_Ti: float | None = None  # wanted 2 pi Ti / period
    warm_up: float | None = None  # periods simulated before the record
    FIELDS: ClassVar[tuple[str, ...]] = (
        "samples_per_period",
        "periods",
        "noise_ratio",
        "w_Ti",
        "warm_up",
    )

    @property
    def empty(self) -> bool:
        """Whether nothing is left to settle."""
        return all(getattr(self, f.name) is None for f in fields(self))


@dataclass(frozen=True)
class Scaled:
    """A valve or effect whose parameters wait for the cell's scale: "S", "J", "period" or "pv" by
    name; others stand.
    """

    name: str
    parameters: dict[str, Value] = field(default_factory=dict)
    scale: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Echo:
    """The load that makes a healthy loop move as its sticky sibling does."""

    of: Draft
    kind: str  # one of `ECHOES`
    cut: float | None  # the load's `cut`; None: its own default


@dataclass(frozen=True)
class Draft:
    """One scenario before its rules are settled."""

    loop: Loop  # sampling, noise and (where `ultimate` says so) gain are first guesses
    tags: dict[str, float | int | str | None]  # its place in the grid
    rules: Rules
    seed: int
    id: str  # of what is asked for, whatever the rules settle
    # disturbances, amplitude in PV std of the twin (at "input": in its S), times in its periods
    loads: tuple[dict[str, Any], ...] = ()
    ultimate: float | None = None  # gain over the ultimate gain of the sampled loop
    overrides: Mapping[str, Value] | None = None  # dotted loop keys that have the last word
    # parameters beyond (S, J); a friction model takes the cell's (S, J) through its own mapping
    valve: Scaled = Scaled("ideal")
    effects: tuple[Scaled, ...] = ()  # of the loop file
    mv_noise: float = 0.0  # std on the recorded MV, in S
    moves: tuple[tuple[float, float], ...] = ()  # set-point steps
    echo: Echo | None = None  # of a healthy loop: loop, loads and noise are the sibling's


def cell_group(
    settings: Mapping[str, Any],
    members: Iterable[tuple[str, Mapping[str, Any], tuple[dict[str, Any], ...]]],
    tags: Mapping[str, Any],
    overrides: Mapping[str, Value],
    where: str,
) -> tuple[Loop, Rules, tuple[Draft, ...]]:
    """Build the sticky twin of a cell and the drafts of its members."""
    # The loop of the cell, and how long and fine it is simulated
    settings = {"speed": 1.0, "step": 0.0, "excitation": "setpoint", "tuning": "medium", **settings}
    table = _loop_table(settings, where)
    rules = _rules_of(settings)
    if rules.samples_per_period is None or rules.periods is None:
        raise SpecError(f"{where}: samples_per_period and periods are needed, as axis or draw")

    # The sticky loop from which periods and sizes are measured
    twin_valve = _valve_of("choudhury", settings, where)
    twin = overridden(Loop.from_table({**table, "valve": twin_valve}, where), overrides)

    # Each member of the cell: its tuning, valve and, where it is one, the echo of its sibling
    names = (
        "Td_over_T",
        "Td_over_Ti",
        "S_over_2J",
        "noise_ratio",
        "disturbance",
        "tuning",
        "samples_per_period",
    )
    drafts = []
    for name, own, loads in members:
        if own.get("tuning", SAME) == SAME:
            tuning = settings["tuning"]
        else:
            tuning = own["tuning"]
        if tuning not in (tuple(FOPTD_LAG) + tuple(ULTIMATE)):
            raise SpecError(
                f"{where}: tuning {tuning!r} is unknown,"
                f" {suggestion(str(tuning), tuple(FOPTD_LAG) + tuple(ULTIMATE))}"
            )
        mine = {**settings, **own, "tuning": settings["tuning"]}
        valve = _valve_of(own["valve"].name, mine, where)
        echo = None
        if "echo" in own:
            sibling = next(d for d in drafts if d.tags["member"] == own["of"])
            cut = settings.get("cut")
            echo = Echo(sibling, own["echo"], None if cut is None else float(cut))

        # The loop itself, with what was changed on the command line
        loop = overridden(
            Loop.from_table({**_loop_table(mine, where), "valve": valve}, where), overrides
        )

        # The axes' values as tags of the scenario
        found = {}
        for key in names:
            found[key] = own.get(key)
        found.update(
            member=name,
            process=settings["process"],
            controller=settings["controller"],
            valve=valve["model"],
            tuning=tuning,
            S_over_2J=0.0 if valve["model"] == "ideal" else settings["S_over_2J"],
            cell_S_over_2J=settings["S_over_2J"],
            echo="none" if echo is None else echo.kind,
            cut=None if echo is None else echo.cut,
            disturbance=own.get("disturbance", "none"),
            samples_per_period=10.0 * round(float(rules.samples_per_period) / 10.0),
            S=0.0 if valve["model"] == "ideal" else mine["S"],
        )
        told = {**tags, **found}

        # What the draft still needs in order to be settled
        more = (
            own["valve"],
            mine["effects"],
            float(mine.get("mv_noise", 0.0)),
            mine["sp_moves"],
            echo,
        )
        drafts.append(
            Draft(
                loop,
                told,
                rules,
                own["seed"],
                scenario_id(told, own["seed"]),
                loads,
                ULTIMATE.get(tuning),
                overrides,
                *more,
            )
        )
    return twin, rules, tuple(drafts)


# axes of a whole loop that are ratios of its numbers
RATIOS = ("Td_over_T", "Td_over_Ti", "S_over_2J")


def scenario_id(tags: Mapping[str, Any], seed: int) -> str:
    """Return the id of a scenario: a hash of what is asked for, and of no computed number."""
    return content_hash({**{key: tags[key] for key in _IDENTITY}, "seed": str(seed)})


def _rules_of(settings: Mapping[str, Any]) -> Rules:
    return Rules(**{name: settings.get(name) for name in Rules.FIELDS})


def loop_axes(loop: Loop) -> dict[str, float | int | str | None]:
    """Return the grid axes that a whole loop shows by itself."""
    # S over 2 J of the valve, infinite without a slip jump, 0 without friction
    plant = loop.plant
    Ti = loop.controller.Ti
    S = loop.valve.parameters.get("S")
    J = loop.valve.parameters.get("J")
    ratio = None
    if loop.valve.name == "ideal":
        ratio = 0.0
    elif isinstance(S, (int, float)) and S > 0:
        if isinstance(J, (int, float)) and J > 0:
            ratio = S / (2 * J)
        else:
            ratio = math.inf

    # The axes; None where the loop has no such ratio
    return {
        "Td_over_T": plant.Td / plant.T if plant.T else None,
        "Td_over_Ti": plant.Td / Ti if plant.integrating and Ti else None,
        "S_over_2J": ratio,
        "cell_S_over_2J": ratio,
        "echo": "+".join(
            d.parameters.get("kind", ECHOES[0]) for d in loop.disturbance if d.name == "echo"
        )
        or "none",
        "disturbance": "+".join(d.name for d in loop.disturbance) or "none",
        "process": plant.type,
        "controller": loop.controller.type,
        "valve": loop.valve.name,
    }


def with_ratios(loop: Loop, ratios: Mapping[str, Value], where: str) -> Loop:
    """Return a loop whose dead time and slip jump have these ratios; everything else stays.

    Td_over_T and Td_over_Ti set the dead time. S_over_2J sets J beside the valve's S: inf is a
    dead-band, and 0 a healthy valve.
    """
    # Each ratio is a number from 0
    for name, value in ratios.items():
        if isinstance(value, (bool, str)) or not isinstance(value, (int, float)) or not value >= 0:
            raise SpecError(f"{where}: {name} = {value!r}; a number from 0 is needed")
        if name == "S_over_2J":
            loop = _with_slip_jump(loop, float(value), where)
            continue

        # The dead time follows from its ratio to T or Ti
        unit, scale = {
            "Td_over_T": ("plant.T", loop.plant.T),
            "Td_over_Ti": ("controller.Ti", loop.controller.Ti),
        }[name]
        if not scale or math.isinf(value):
            raise SpecError(
                f"{where}: {name} = {value:g} needs a loop with {unit}, and a finite ratio"
            )
        loop = loop.with_all({"plant.Td": value * scale})
    return loop


def _with_slip_jump(loop: Loop, ratio: float, where: str) -> Loop:
    if ratio == 0.0:
        return loop.with_all({"valve": {"model": "ideal"}})
    S = loop.valve.parameters.get("S")
    if not isinstance(S, (int, float)) or not S > 0 or "J" not in loop.valve.parameters:
        raise SpecError(
            f"{where}: S_over_2J = {ratio:g} needs a valve with S > 0 and J, such as model"
            f" 'choudhury', not {loop.valve.name!r}"
        )
    return loop.with_all({"valve.J": S / (2.0 * ratio)})


def ultimate_gain(Td_over_T: float) -> float:
    """Return the ultimate K Kc of a first-order plant with dead time under P control."""
    lo = 1e-9
    hi = math.pi / Td_over_T
    for _ in range(60):
        w = 0.5 * (lo + hi)
        if w * Td_over_T + math.atan(w) < math.pi:
            lo = w
        else:
            hi = w
    return math.sqrt(1.0 + lo * lo)


def _loop_table(s: Mapping[str, Any], where: str) -> dict[str, Any]:
    for key in (
        "K",
        "T",
        "S",
        "S_over_2J",
        "Td_over_T" if s["process"] == "foptd" else "Td_over_Ti",
    ):
        if key not in s:
            raise SpecError(f"{where}: {key} is needed, as axis or draw ({SETTINGS[key]})")
    if s["tuning"] not in FOPTD_LAG:
        raise SpecError(
            f"{where}: tuning {s['tuning']!r} of the sticky twin,"
            f" {suggestion(str(s['tuning']), FOPTD_LAG)}"
        )
    if s["excitation"] not in EXCITATIONS:
        raise SpecError(
            f"{where}: excitation {s['excitation']!r},"
            f" {suggestion(str(s['excitation']), EXCITATIONS)}"
        )
    K = float(s["K"])
    T = float(s["T"])
    speed = float(s["speed"])
    rest = float(s.get("pv_rest", _REST))
    if s["process"] == "foptd":
        ratio = float(s["Td_over_T"])
        Td = ratio * T
        plant = {"type": "foptd", "K": K, "T": T, "Td": Td}
        lag = FOPTD_LAG[s["tuning"]] / speed * max(Td, 0.1 * T)
        Kc = T / (K * (lag + Td))
        Ti = min(T, 4.0 * (lag + Td))
        if s["controller"] == "P":
            Kc = _P_SHARE[s["tuning"]] * speed * ultimate_gain(max(ratio, 0.01)) / K
        size = K * s["S"]
    elif s["process"] == "integrating":
        Ti = T
        Td = float(s["Td_over_Ti"]) * T
        plant = {"type": "integrating", "K": K / T, "Td": Td}
        Kc = _INTEGRATING_GAIN[s["tuning"]] * speed * 4.0 / K
        size = s["S"] / Kc
    else:
        raise SpecError(
            f"{where}: process {s['process']!r},"
            f" {suggestion(str(s['process']), ('foptd', 'integrating'))}"
        )
    controller = {"type": s["controller"], "Kc": Kc} | (
        {"Ti": Ti} if s["controller"] == "PI" else {}
    )
    table: dict[str, Any] = {
        "plant": plant,
        "controller": controller,
        "sampling": {"Ts": max(Td, 0.1 * T) / 10.0, "n": 1000},
        "setpoint": {"value": rest},
    }
    if "op_rest" in s:
        table["operating_point"] = {"op0": float(s["op_rest"])}
    if s["excitation"] != "load" and s["step"] != 0.0:
        # against the load the set point goes the other way: more loops reach their cycle
        if s["excitation"] == "setpoint":
            step = s["step"]
        else:
            step = -abs(s["step"])
        table["setpoint"]["steps"] = [[0.0, rest + step * size]]
    if s["excitation"] != "setpoint":
        # a load that is there from the first sample on: a ramp that takes no time
        table["disturbance"] = [
            {
                "type": "ramp",
                "amplitude": abs(s["step"]) * s["S"],
                "period": 1e-3 * T,
                "at": "input",
            }
        ]
    return table


def _valve_of(model: str, s: Mapping[str, Any], where: str) -> dict[str, Any]:
    # A sound valve, or sizes from S and the ratio
    if model == "ideal":
        return {"model": "ideal"}
    S = float(s["S"])
    ratio = float(s["S_over_2J"])
    if not ratio > 0:
        raise SpecError(
            f"{where}: S_over_2J = {ratio}; the sticky twin needs a number above 0, or inf"
        )

    # Without slip jump it is a dead-band
    if math.isinf(ratio):
        if model == "choudhury":
            return {"model": "deadband", "S": S}
        return {"model": model, "S": S, "J": 0.0}
    return {"model": model, "S": S, "J": S / (2.0 * ratio)}


def overridden(loop: Loop, overrides: Mapping[str, Value]) -> Loop:
    """Return a member's loop with the keys that have the last word."""
    # a healthy sibling has no S to set
    healthy = loop.valve.name == "ideal"
    changes = {}
    for key, value in overrides.items():
        if not (healthy and key.partition(".")[0] == "valve"):
            changes[key] = value
    return loop.with_all(changes)
