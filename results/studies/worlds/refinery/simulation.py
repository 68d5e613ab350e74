"""From a case and its effects to the recorded columns: build the numbers, run the loop, archive the
record.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from results.studies.withheld.world import TestPlan, operated
from results.studies.worlds.refinery import archive, loads, physics, valves
from results.studies.worlds.refinery.controller import FORMS, RESET, RULES, WINDUPS, Controller
from results.studies.worlds.refinery.physics import SUBSTEPS, Plant, Sensor, Signals
from results.studies.worlds.refinery.setpoint import pattern
from results.studies.worlds.refinery.valves import Valve
from simbench.detectors.compiled import compiled

# random streams of one realisation: an added effect never changes the load or the noise of the loop
# itself
_LOAD, _NOISE, _WHITE, _DRIFT, _SPIKES_LOOP, _SPIKES_RECORD, _HELD, _MANUAL, _EFFECT_LOAD = range(9)
# beyond those of the effects' loads
_CLOCK, _LOST, _MISSED, _SHIFT = range(50, 54)

_LoadMaker = Callable[[np.random.Generator, int, float, int], np.ndarray]


@dataclass
class Setup:
    """Everything that one run needs in addition to its seed; effects change it before the run."""

    plant: Plant
    controller: Controller
    valve: Valve
    sensor: Sensor
    # (rng, cells, h, cell of the record's middle) -> load in %
    loads: list[_LoadMaker] = field(default_factory=list)
    noise_std: float = 0.0
    white_std: float = 0.0  # added in quadrature, PV units
    drift: tuple[float, float] = (0.0, 0.0)  # rate, walk
    spikes_loop: tuple[float, float] = (0.0, 0.0)  # rate, size
    spikes_record: tuple[float, float] = (0.0, 0.0)
    frozen: tuple[float, float] = (0.0, 0.0)  # length in scans, share
    manual: tuple[float, float] = (0.0, 0.0)
    # length in scans, share, whether PV is tracked
    missed: tuple[float, float, bool] = (0.0, 0.0, False)
    shifts: tuple[float, float] = (0.0, 0.0)  # rate, size
    record_quantum: float = 0.0
    door: float = 0.0


def build(case: dict, nominal: bool = False) -> Setup:
    """Return the numbers of a loop without any effect; `nominal`: with the baseline's plant."""
    plant, controller = case["baseline"]["plant"] if nominal else case["plant"], case["controller"]
    integrating = plant["type"] == "integrating"
    sign = 1.0 if controller["direction"] == "reverse" else -1.0
    # the baseline's plant has the lags of sound instruments in it, unless it states them
    lag = {k: 0.0 if nominal else float(case.get(k, 0.0)) for k in ("actuator", "filter")}
    if case.get("filter_stated"):
        lag["filter"] = float(case["filter"])
    return Setup(
        Plant(
            integrating=integrating,
            K=float(plant["K"]),
            T=1.0 if integrating else float(plant["T"]),
            Td=float(plant["Td"]),
            lag1=float(plant.get("lag1", 0.0)),
            lag2=float(plant.get("lag2", 0.0)),
            bend=0.0 if nominal else float(case.get("bend", 0.0)),
        ),
        Controller(
            Kc=sign * controller["Kc"],
            Ti=float(controller["Ti"] or 0.0),
            Ts=float(case["Ts"]),
            bias=float(case["m0"]),
            velocity=controller["form"] == FORMS[1],
            rule=RULES.index(controller["rule"]),
            windup=(*WINDUPS, RESET).index(controller["windup"]),
            op_step=float(controller["op_step"]),
            Td=float(controller.get("Td", 0.0)),
            b=float(controller.get("b", 1.0)),
            c=float(controller.get("c", 0.0)),
        ),
        Valve(known_play=float(case["known_play"]), lag=lag["actuator"]),
        Sensor(
            lag=lag["filter"],
            count=float(case["sensor"]["count"]),
            count_offset=float(case["sensor"]["count_offset"]),
            flow_noise=1.0 if case["noise"]["kind"] == "flow" else 0.0,
        ),
        # and what a filter will take away of the noise, which it does not have
        noise_std=float(case["noise"]["std"])
        * (1.0 if nominal and not case.get("filter_stated") else case["noise"].get("gain", 1.0)),
    )


def _stream(seed: int, number: int) -> np.random.Generator:
    return np.random.default_rng([seed, number])


def _signals(setup: Setup, case: dict, seed: int) -> Signals:
    warm, n = case["warm"], case["n"]
    count, h = warm + n, case["Ts"] / SUBSTEPS
    cells = count * SUBSTEPS
    load = loads.ordinary(_stream(seed, _LOAD), cells, h, case["load"])
    for i, maker in enumerate(setup.loads):
        load = load + maker(_stream(seed, _EFFECT_LOAD + i), cells, h, (warm + n // 2) * SUBSTEPS)
    noise = setup.noise_std * loads.noise(_stream(seed, _NOISE), count, case["noise"])
    if setup.white_std > 0.0:
        noise = noise + setup.white_std * _stream(seed, _WHITE).standard_normal(count)
    error, spikes = np.zeros(count), np.zeros(count)
    held, manual = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    if any(setup.drift):
        error = loads.wander(_stream(seed, _DRIFT), count, case["Ts"], *setup.drift, warm + n // 2)
    if setup.spikes_loop[0] > 0.0:
        spikes = loads.spikes(_stream(seed, _SPIKES_LOOP), count, *setup.spikes_loop)
    if setup.frozen[1] > 0.0:
        held = loads.gate(_stream(seed, _HELD), count, *setup.frozen)
    if setup.manual[1] > 0.0:
        manual = loads.gate(_stream(seed, _MANUAL), count, *setup.manual)
    missed, shift = np.zeros(count, dtype=int), np.zeros(count)
    if setup.missed[1] > 0.0:
        idle = loads.gate(_stream(seed, _MISSED), count, *setup.missed[:2])
        missed[idle] = 1 + setup.missed[2]
    if setup.shifts[0] > 0.0:
        h = case["Ts"]
        shift = setup.shifts[1] * loads.jumps(_stream(seed, _SHIFT), count, h, setup.shifts[0])
    none, scans = np.full(count, np.nan), np.zeros(count, dtype=bool)
    return Signals(
        pattern(case["setpoint"], warm, n, case["Ts"]),
        load,
        noise,
        error,
        spikes,
        held,
        manual,
        none,
        scans,
        missed,
        shift,
    )


def run(setup: Setup, case: dict, seed: int, plan: TestPlan | None = None) -> dict[str, np.ndarray]:
    """Run the loop, or a test on it, once and return what the archive holds; `mv` is always
    there.
    """
    signals = _signals(setup, case, seed)
    if plan is not None:
        signals.sp[case["warm"] :] += plan.sp
        signals.hand[case["warm"] :] = plan.op
        signals.between[:] = (np.arange(signals.sp.size) - case["warm"]) % plan.faster != 0
    stem = valves.rest(valves.untrim(case["m0"], setup.valve.R))
    control = setup.controller._replace(bias=float(valves.untrim(case["m0"], setup.valve.R)))
    raw = compiled(physics.close_loop)(
        setup.plant,
        control,
        setup.valve,
        setup.sensor,
        signals,
        float(case["m0"]),
        float(case["pv0"]),
        stem,
    )
    columns = _archive(raw[:5], signals.sp, setup, case, seed, plan is not None and plan.raw)
    return columns if plan is None else operated(columns, raw[5][case["warm"] :], plan, seed)


def _archive(
    shown: tuple, sp: np.ndarray, setup: Setup, case: dict, seed: int, raw: bool = False
) -> dict[str, np.ndarray]:
    seen, op, mv, seen_mean, mv_mean = shown
    warm, n, how = case["warm"], case["n"], case["archive"]
    if raw:
        columns = {"sp": sp[warm:], "op": op[warm:], "pv": seen[warm:], "mv": mv[warm:]}
        return {"t": np.round(np.arange(n) * case["Ts"], 6), **columns}
    pv = (seen_mean if how["averaging"] else seen)[warm:]
    if setup.spikes_record[0] > 0.0:
        pv = pv + loads.spikes(_stream(seed, _SPIKES_RECORD), n, *setup.spikes_record)
    pv = archive.lattice(pv, setup.record_quantum)
    if how["band"] > 0.0:
        pv = compiled(archive.exceptions)(pv, how["band"])
    if setup.door > 0.0:
        pv = compiled(archive.swinging_door)(pv, setup.door)
    # the mean of the scan before, or a historian that reads before the controller writes: OP and MV
    # are one scan old
    shift = 1 if how["late"] or how["averaging"] else 0
    past = slice(warm - shift, warm + n - shift)
    columns = {
        "sp": sp[warm:],
        "op": op[past],
        "pv": pv,
        "mv": mv_mean[warm:] if how["averaging"] else mv[past],
    }
    printed = {
        name: archive.printed(x, how["style"], how["places"][name]) + 0.0
        for name, x in columns.items()
    }
    clock = np.arange(n) * case["Ts"]
    late, lost = how.get("jitter", 0.0), how.get("lost", 0.0)
    if late > 0.0:
        clock = clock + late * case["Ts"] * _stream(seed, _CLOCK).random(n)
    rows = {"t": np.round(clock, 6), **printed}
    if lost == 0.0:
        return rows
    kept = _stream(seed, _LOST).random(n) >= lost
    kept[[0, -1]] = True
    return {name: x[kept] for name, x in rows.items()}
