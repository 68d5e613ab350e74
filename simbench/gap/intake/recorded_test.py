"""Read the records of additional tests with the settings that they were made with, and refuse unfit
ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError, RecordError, nearest
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_record
from simbench.detectors.records.tables import read_sheet
from simbench.detectors.signal.holds import still
from simbench.scenarios.parts import Sampling
from simbench.scenarios.plant import Controller
from simbench.scenarios.spec import Loop
from simbench.scenarios.toml import read_toml

TEST_IDS = ("mv", "sp_steps", "kc_half", "bump", "stairs", "still", "raw", "fast", "lab")
_TABLES = {
    "test": (),  # whatever was planned may be there
    "controller": ("Kc", "Kc_ratio", "Ti", "Ti_ratio", "type", "direction"),
    "sampling": ("Ts", "n"),
}
SAME_TS = 0.01  # relative difference of two sampling periods that a time column may leave
FEWEST = 40  # samples; a step needs as many to show in the noise
_FEWEST_LAB = 8  # lab samples, below which a drift of the sensor and one of the load look alike


@dataclass(frozen=True, eq=False)
class RecordedTest:
    """A test as it was recorded: where OP was the operator's, lab samples (NaN between), and its
    settings by table.

    `loop` is the baseline with the settings in it.
    """

    path: str
    record: LoopRecord
    manual: np.ndarray
    lab: np.ndarray | None
    settings: dict[str, dict[str, Any]]
    loop: Loop

    @property
    def name(self) -> str:
        """The file's name."""
        return Path(self.path).name

    @property
    def id(self) -> str:
        """The test's name on the menu, "" of one that was not declared."""
        return str(self.settings.get("test", {}).get("id", ""))


def read_test(given: str, baseline: Loop, **about: Any) -> RecordedTest:
    """Read RECORD[:SETTINGS.toml]; a TOML of the record's name in its folder holds the settings
    where none is named.
    """
    file, more = files_of(given)
    neighbour = Path(file).with_suffix(".toml")
    table = read_toml(more) if more else read_toml(neighbour) if neighbour.is_file() else {}
    # a loop file of that name is a baseline
    settings = _settings(table, more or str(neighbour)) if more or "plant" not in table else {}
    record = read_record(file, automatic=False, **about)
    manual = np.asarray(record.meta.get("manual", np.zeros(record.n, dtype=bool)))
    test = RecordedTest(
        file,
        record,
        manual,
        _lab_samples(file, record),
        settings,
        _loop(baseline, settings, record, file),
    )
    _refuse(test)
    return test


def files_of(given: str) -> tuple[str, str]:
    """Return the two files of RECORD[:SETTINGS.toml], the second "" where it is not named."""
    if not (given.endswith(".toml") and ":" in given):
        return given, ""
    file, _, more = given.rpartition(":")
    return file, more


def _lab_samples(path: str | Path, record: LoopRecord) -> np.ndarray | None:
    """Return the `lab` samples of a record, shape (n,), NaN between; None where it has none."""
    if Path(path).suffix.lower() == ".mat":
        return None
    columns = {str(k).strip().lower(): v for k, v in read_sheet(Path(path)).columns.items()}
    if "lab" not in columns:
        return None
    try:
        lab = np.array(
            [float(x) if str(x).strip() not in ("", "nan") else np.nan for x in columns["lab"]]
        )
    except ValueError as error:
        raise RecordError(f"{path}: lab holds text where a number should be ({error})") from None
    if not np.isfinite(lab).any():
        return None
    rows = record.meta["rows"]
    if lab.size != rows.size:
        raise RecordError(f"{path}: lab has {lab.size} rows, the signals {rows.size}")
    taken = np.isfinite(lab) & (rows >= 0) & (rows < record.n)
    placed = np.full(record.n, np.nan)
    placed[rows[taken]] = lab[taken]
    return placed


def _settings(table: dict[str, Any], where: str) -> dict[str, dict[str, Any]]:
    for name, rows in table.items():
        if name not in _TABLES or not isinstance(rows, dict):
            raise ParameterError(
                f"{where}: [{name}] is no table of a test's settings; {nearest(name, _TABLES)}"
            )
        for key, value in rows.items() if name != "test" else ():
            if key not in _TABLES[name]:
                raise ParameterError(
                    f"{where}: {name}.{key} is unknown; {nearest(key, _TABLES[name])}"
                )
            if key not in ("type", "direction") and not (_is_number(value) and value > 0):
                raise ParameterError(
                    f"{where}: {name}.{key} = {value!r}; a number above 0 is needed"
                )
    test = table.get("test", {})
    if "id" in test and test["id"] not in TEST_IDS:
        raise ParameterError(
            f"{where}: test.id = {test['id']!r}; {nearest(str(test['id']), TEST_IDS)}"
        )
    lab_std = test.get("lab_std", 0.0)
    if not (_is_number(lab_std) and lab_std >= 0):
        raise ParameterError(
            f"{where}: test.lab_std = {lab_std!r}; a number of at least 0 is needed"
        )
    return table


def _is_number(x: Any) -> bool:
    return isinstance(x, (int, float)) and not isinstance(x, bool) and bool(np.isfinite(x))


def _loop(
    baseline: Loop, settings: dict[str, dict[str, Any]], record: LoopRecord, where: str
) -> Loop:
    """Return the baseline with a test's settings in it; its Ts is that of the time column, which a
    stated one must meet.
    """
    control = settings.get("controller", {})
    Ts = settings.get("sampling", {}).get("Ts")
    if Ts is not None and abs(record.Ts / Ts - 1.0) > SAME_TS:
        raise RecordError(
            f"{where}: Ts = {record.Ts:g} s by its time column, but its [sampling] says {Ts:g} s;"
            " they must agree within 1 %"
        )
    period = baseline.sampling.Ts
    if Ts is None and abs(record.Ts / period - 1.0) > SAME_TS:
        raise RecordError(
            f"{where}: Ts = {record.Ts:g} s by its time column, the baseline's is {period:g} s; a"
            " log of another pace is declared by Ts of [sampling] in the test's settings"
        )
    return baseline.replace(
        controller=_retune(baseline.controller, control),
        sampling=Sampling(Ts=record.Ts, n=record.n),
    )


def _retune(controller: Controller, settings: Mapping[str, Any]) -> Controller:
    """Return the controller with the Kc and Ti of a test: stated, or as ratios of its own."""
    stated = controller.model_dump(exclude_none=True)
    tuning = {}
    for name in ("Kc", "Ti"):
        if name in stated:
            ratio = settings.get(f"{name}_ratio")
            tuning[name] = stated[name] * ratio if ratio else settings.get(name, stated[name])
    return controller.replace(**tuning)


def _refuse(test: RecordedTest) -> None:
    """Refuse a test that shows nothing, or not what it declares."""
    r = test.record
    manual = test.manual.any()
    sampled = 0 if test.lab is None else int(np.isfinite(test.lab).sum())
    declared = f"declared as test {test.id!r}, but"
    wrong = {
        f"{r.n} samples; a test needs at least {FEWEST} to show anything": r.n < FEWEST,
        f"PV is constant ({r.pv[0]:g}); nothing can be told from this test": still(r.pv),
        f"OP is constant ({r.op[0]:g}) in AUTO; a column `mode` that says MAN is needed": (
            still(r.op) and not manual
        ),
        f"OP runs from {r.op.min():g} to {r.op.max():g}, not in % of travel; give --op-span": (
            r.op_percent is None
        ),
        f"{declared} it has no column mv": test.id == "mv" and r.mv is None,
        f"{declared} no row of a column `mode` says MAN": (
            test.id in ("bump", "stairs", "still") and not manual
        ),
        f"{declared} it has {sampled} samples in column lab; at least {_FEWEST_LAB} are needed": (
            test.id == "lab" and sampled < _FEWEST_LAB
        ),
    }
    for sentence, is_wrong in wrong.items():
        if is_wrong:
            raise RecordError(f"{test.path}: {sentence}")
