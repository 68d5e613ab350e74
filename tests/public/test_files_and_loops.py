"""What people and scripts rely on in loop files and records: keys, defaults, signs, columns, gaps,
units, what is refused.
"""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

from simbench import read_record
from simbench.cli import main
from simbench.detectors.quality import inspect

LOOP = {
    "plant": {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 2.0},
    "controller": {"type": "PI", "Kc": 1.0, "Ti": 10.0},
    "sampling": {"Ts": 1.0},
}
STICKY = {"model": "choudhury", "S": 5.0, "J": 2.0}


def toml(tables: dict) -> str:
    def table(name: str, content: dict) -> str:
        return "\n".join([name, *(f"{k} = {json.dumps(v)}" for k, v in content.items())])

    parts = [
        table(f"[[{n}]]", one)
        for n, many in tables.items()
        if isinstance(many, list)
        for one in many
    ]
    return "\n".join(
        [*(table(f"[{n}]", c) for n, c in tables.items() if isinstance(c, dict)), *parts]
    )


def changed(**tables) -> dict:
    loop = {name: dict(content) for name, content in LOOP.items()}
    for name, content in tables.items():
        loop[name] = content if isinstance(content, list) else loop.get(name, {}) | content
    return {
        n: c if isinstance(c, list) else {k: v for k, v in c.items() if v is not None}
        for n, c in loop.items()
    }


@pytest.fixture
def simulate(tmp_path, capsys):
    def run(*options: str, **tables) -> pd.DataFrame:
        (tmp_path / "loop.toml").write_text(toml(changed(**tables)))
        code = main(
            ["simulate", str(tmp_path / "loop.toml"), "-o", str(tmp_path / "rec.csv"), *options]
        )
        message = capsys.readouterr().err
        assert code == 0, message
        return pd.read_csv(tmp_path / "rec.csv")

    return run


@pytest.fixture
def detect(tmp_path, capsys):
    """Judge a table by he and yamashita; return the code, stderr and the verdicts by method."""

    def run(frame: pd.DataFrame, *options: str, methods: str = "he,yamashita"):
        frame.to_csv(tmp_path / "rec.csv", index=False)
        code = main(["detect", str(tmp_path / "rec.csv"), "--method", methods, "--json", *options])
        out, err = capsys.readouterr()
        return code, err, {v["method"]: v for v in json.loads(out)} if code == 0 else {}

    return run


@pytest.fixture(scope="module")
def record(tmp_path_factory) -> pd.DataFrame:
    folder = tmp_path_factory.mktemp("sticky")
    steps = {"steps": [[10, 55]]}
    loop = changed(valve=STICKY, noise={"std": 0.1}, setpoint=steps, sampling={"n": 900})
    (folder / "loop.toml").write_text(toml(loop))
    assert (
        main(["simulate", str(folder / "loop.toml"), "-o", str(folder / "rec.csv"), "--seed", "1"])
        == 0
    )
    return pd.read_csv(folder / "rec.csv")


def by_hand(loop: dict, load_in: np.ndarray, load_out: np.ndarray) -> dict[str, np.ndarray]:
    """The loop as its description reads, sample by sample, with Choudhury's valve as an automaton
    of its own.
    """
    plant, controller, Ts = loop["plant"], loop["controller"], loop["sampling"]["Ts"]
    rest = {"op0": 50.0, "pv0": loop.get("setpoint", {}).get("value", 50.0)} | loop.get(
        "operating_point", {}
    )
    n, late = load_in.size, round(plant["Td"] / Ts)
    point = np.full(n, loop.get("setpoint", {}).get("value", 50.0))
    for t, value in loop.get("setpoint", {}).get("steps", []):
        point[int(np.ceil(t / Ts)) :] = value
    s = -1.0 if controller.get("direction") == "direct" else 1.0
    fs, fd = (STICKY["S"] + STICKY["J"]) / 2, (STICKY["S"] - STICKY["J"]) / 2
    u = v = before = rest["op0"]
    x, error, way, moving, pipe = 0.0, 0.0, 0, False, [0.0] * late
    out = {name: np.empty(n) for name in ("sp", "op", "pv", "mv")}
    for k in range(n):
        y = rest["pv0"] + x + load_out[k]
        e = point[k] - y
        if controller["type"] == "P":
            u = rest["op0"] + s * controller["Kc"] * e
        else:
            u += s * controller["Kc"] * ((e - error) + Ts / controller["Ti"] * e)
        u, error = min(max(u, 0.0), 100.0), e
        if moving and (u - before) * way <= 0:
            moving = False
        if not moving and abs(u - v) > fs:
            moving, way = True, 1 if u > v else -1
        if moving:
            v = min(max(u - way * fd, 0.0), 100.0)
        before = u
        pipe.append(v - rest["op0"] + load_in[k])
        drive = plant["K"] * pipe.pop(0)
        if plant["type"] == "integrating":
            x += Ts * drive
        else:
            keeps = np.exp(-Ts / plant["T"])
            x = keeps * x + (1 - keeps) * drive
        for name, value in zip(out, (point[k], u, y, v), strict=True):
            out[name][k] = value
    return out


STEP = {"steps": [[10, 55]]}
WAVE = {"type": "sine", "amplitude": 3.0, "period": 60.0}
INTEGRATING = {"type": "integrating", "K": 0.1, "T": None}


@pytest.mark.parametrize(
    "tables",
    [
        {"setpoint": STEP},
        {"setpoint": STEP, "plant": {"K": -1.0}, "controller": {"direction": "direct"}},
        {
            "setpoint": {"steps": [[10, 120], [150, 60]]}
        },  # OP at its limit, and back at once: anti-windup
        {"setpoint": STEP, "plant": INTEGRATING},
        {
            "setpoint": STEP,
            "plant": INTEGRATING,
            "controller": {"type": "P", "Kc": 2.0, "Ti": None},
        },
        {"setpoint": STEP, "disturbance": [WAVE | {"at": "input"}]},
        {"setpoint": STEP, "disturbance": [WAVE | {"at": "output"}]},
        {
            "setpoint": {"value": 70.0, "steps": [[10, 75]]},
            "operating_point": {"op0": 30.0, "pv0": 70.0},
        },
        {"operating_point": {"op0": 30.0, "pv0": 60.0}},
        {"setpoint": {"value": 70.0, "steps": [[10, 75]]}},  # pv0 is the set point's value
    ],
)
def test_a_run_is_the_loop_as_it_is_described(simulate, tables):
    n = 300  # a sticky loop is chaotic: beyond that rounding shows
    loop = changed(valve=STICKY, **tables)
    simulated = simulate(valve=STICKY, sampling={"n": n}, **tables)
    assert list(simulated.columns) == ["t_s", "sp", "op", "pv", "mv"]
    wave = 3.0 * np.sin(2 * np.pi * np.arange(n) / 60.0)
    at = [d["at"] for d in tables.get("disturbance", [])]
    loads = [wave if where in at else np.zeros(n) for where in ("input", "output")]
    for name, expected in by_hand(loop, *loads).items():
        np.testing.assert_allclose(simulated[name], expected, atol=1e-9, err_msg=name)


def test_what_may_be_absent_has_its_default_and_a_run_begins_at_rest(simulate):
    run = simulate()
    assert len(run) == 4000
    assert (run[["sp", "op", "pv", "mv"]] == 50.0).all().all()


@pytest.mark.parametrize("kind", ["sine", "steps", "ramp", "random_walk", "propagated"])
@pytest.mark.parametrize("at", ["input", "output"])
def test_every_disturbance_acts_at_either_place(simulate, kind, at):
    run = simulate(
        sampling={"n": 400},
        disturbance=[{"type": kind, "amplitude": 2.0, "period": 60.0, "at": at}],
    )
    assert run.pv.std() > 0


MODELS = {
    "ideal": {},
    "deadband": {"S": 5.0},
    "deadzone": {"D": 5.0},
    "choudhury": {"S": 5.0, "J": 2.0},
    "choudhury_literal": {"S": 5.0, "J": 2.0},
    "kano": {"S": 5.0, "J": 2.0},
    "he": {"fs": 3.5, "fd": 1.5},
    "stenman": {"d": 3.0},
    "coulomb": {},
    "karnopp": {},
    "stribeck": {},
    "lugre": {},
}


@pytest.mark.parametrize("model", MODELS)
def test_every_valve_of_the_loop_file_runs(simulate, model):
    run = simulate(valve={"model": model, **MODELS[model]}, sampling={"n": 60}, setpoint=STEP)
    assert np.isfinite(run.to_numpy()).all()


@pytest.mark.parametrize("name", ["deadband", "deadzone", "valve_lag", "valve_characteristic"])
def test_valve_effects_compose_with_a_valve_model(simulate, name):
    numbers = {
        "deadband": {"S": 3.0},
        "deadzone": {"D": 3.0},
        "valve_lag": {"tau": 3.0},
        "valve_characteristic": {"R": 30.0},
    }
    both = simulate(
        valve=STICKY, effect=[{"name": name, **numbers[name]}], sampling={"n": 200}, setpoint=STEP
    )
    alone = simulate(valve=STICKY, sampling={"n": 200}, setpoint=STEP)
    assert not both.pv.equals(alone.pv)


def test_the_effect_stiction_makes_an_ideal_valve_choudhurys(simulate):
    by_effect = simulate(
        effect=[{"name": "stiction", "S": 5.0, "J": 2.0}], sampling={"n": 300}, setpoint=STEP
    )
    assert by_effect.equals(simulate(valve=STICKY, sampling={"n": 300}, setpoint=STEP))


def test_columns_go_by_name_in_any_case_and_order(record, detect):
    expected = detect(record)[2]
    for names in (str.upper, str.title):
        other = record.rename(columns={c: names(c) for c in record.columns})
        assert detect(other[other.columns[::-1]])[2] == expected
    stamps = pd.Timestamp("2026-01-01") + pd.to_timedelta(record.t_s, unit="s")
    assert detect(record.drop(columns="t_s").assign(timestamp=stamps.astype(str)))[2] == expected
    assert detect(record.rename(columns={"t_s": "t"}))[2] == expected


def lost(record: pd.DataFrame, rows: slice, column: str | None) -> pd.DataFrame:
    """Rows left out, or their cells in a column emptied."""
    if column is None:
        return record.drop(index=record.index[rows])
    return record.assign(**{column: record[column].mask(np.isin(record.index, record.index[rows]))})


@pytest.mark.parametrize("column", ["op", "pv", "mv", "sp", None])
@pytest.mark.parametrize(("length", "kept"), [(3, 900), (4, 796)])
def test_three_samples_are_bridged_and_flagged_and_more_split_the_record(
    record, tmp_path, column, length, kept
):
    lost(record, slice(104 - length, 104), column).to_csv(tmp_path / "rec.csv", index=False)
    read = read_record(tmp_path / "rec.csv")
    assert read.n == kept
    assert read.mv is not None
    assert "gaps" in inspect(read)


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        (lambda d: lost(d, slice(None, None, 4), "pv"), 2, "at most 20% may be"),
        (lambda d: d.assign(pv=d.pv.astype(object).where(d.index != 5, "abc")), 2, "'abc'"),
        (lambda d: d[:2], 2, "at least 3"),
        (lambda d: d[:3], 0, "too short"),
        (lambda d: d.assign(pv=50.0), 0, "dead_pv"),
        (lambda d: d.assign(op=50.0), 0, "dead_op"),
    ],
)
def test_what_is_refused_and_what_is_no_decision(record, detect, change, code, words):
    status, err, verdicts = detect(change(record))
    assert status == code
    if code:
        assert words in err
        assert err.count("\n") == 1
    for v in verdicts.values():
        assert v["verdict"] == "no_decision"
        assert words in v["reason"]


def test_uneven_time_is_a_gap_above_one_per_cent(record, tmp_path):
    for shift, flagged in ((0.004, False), (0.3, True)):
        late = record.assign(t_s=record.t_s + np.where(record.index >= 450, shift, 0.0))
        late.to_csv(tmp_path / "rec.csv", index=False)
        read = read_record(tmp_path / "rec.csv")
        assert read.Ts == pytest.approx(1.0)
        assert ("gaps" in inspect(read)) is flagged


@pytest.mark.parametrize(
    ("mv", "options", "verdict", "applicable", "reason"),
    [
        (True, (), True, None, "(MV)"),
        (True, ("--kind", "temperature", "--process", "self-regulating"), True, True, "(MV)"),
        (
            False,
            ("--kind", "flow", "--process", "self-regulating"),
            True,
            True,
            "PV of a flow loop as MV",
        ),
        (False, ("--process", "self-regulating"), True, None, "PV as MV, kind of loop unknown"),
        (False, ("--kind", "diff_pressure"), False, False, "PV of a pressure loop"),
        (False, ("--kind", "analyser"), False, False, "PV of an analyser loop"),
        (False, ("--kind", "flow", "--process", "integrating"), False, False, "integrating"),
    ],
)
def test_a_method_of_mv_uses_what_it_may(record, detect, mv, options, verdict, applicable, reason):
    answer = detect(record if mv else record.drop(columns="mv"), *options)[2]["yamashita"]
    assert (answer["verdict"] != "no_decision") is verdict
    assert answer["applicable"] is applicable
    assert reason in answer["reason"]


def test_units_are_reported_and_change_no_verdict(record, detect):
    methods = "he,horch,ellipse,hammerstein,procedure"
    plain = detect(record, methods=methods)[2]
    assert all("OP taken as 0..100 %" in v["reason"] for v in plain.values())
    assert all("process type unknown" in v["reason"] for v in plain.values())
    kelvin = detect(
        record.assign(pv=-1.8 * record.pv + 7, sp=-1.8 * record.sp + 7), methods=methods
    )[2]
    mA = detect(record.assign(op=4 + 0.16 * record.op), "--op-span", "4", "20", methods=methods)[2]
    for other in (kelvin, mA):
        assert {m: v["verdict"] for m, v in other.items()} == {
            m: v["verdict"] for m, v in plain.items()
        }
        assert {v["S_unit"] for v in other.values()} == {"% of travel"}
    assert mA["ellipse"]["indices"]["S_apparent"] == pytest.approx(
        plain["ellipse"]["indices"]["S_apparent"], rel=1e-6
    )
    beyond = detect(record.assign(op=10 * record.op), methods=methods)[2]
    assert {v["S_unit"] for v in beyond.values()} == {"OP units"}
    assert beyond["hammerstein"]["S"] == pytest.approx(
        [10 * x for x in plain["hammerstein"]["S"]], rel=1e-3
    )
