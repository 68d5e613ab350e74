"""Run a test that the diagnosis asks for on the true loop of a record."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from results.studies.withheld.files import csv_of, settings_toml, write_whole
from results.studies.withheld.world import TestPlan
from results.studies.worlds import load_world
from simbench.gap.planning.menu import LEAD, Trial
from simbench.gap.planning.order import ORDER
from simbench.loop.effects import NONE

_SEED = 9000  # added to a record's seed, with the test's place in the order: other load and noise
_SAMPLES_OF_LAB = 40
_LAB_STD = 0.5  # of the stated noise


def planned(trial: Trial, noise: float) -> TestPlan:
    """Return a test of the product's menu as a world runs it; `noise` (PV units) is the stated one.
    What is done in manual begins in automatic.
    """
    n = trial.n
    still = np.zeros(n)
    by_hand = trial.manual & (np.arange(n) >= LEAD)
    lab = trial.id == "lab"
    return TestPlan(
        trial.id,
        n,
        still if trial.manual else trial.moves,
        np.where(by_hand, trial.moves, np.nan),
        Kc_ratio=trial.settings.get("controller", {}).get("Kc_ratio", 1.0),
        raw=trial.id == "raw",
        mv=trial.id == "mv",
        lab=np.linspace(5, n - 5, _SAMPLES_OF_LAB).astype(int) if lab else None,
        lab_std=_LAB_STD * noise if lab else 0.0,
    )


def run_test(
    truth: Mapping[str, Any], trial: Trial, baseline: Mapping[str, Any], place: Path
) -> Path:
    """Run a test on the loop of a row of answers.csv, write its record and settings, and return the
    record.
    """
    known = ("effect", "parameters"), ("effect2", "parameters2")
    if truth.get("foreign"):
        known = (("foreign", "parameters"),)
    acts = [
        {"effect": truth[name], "parameters": truth[numbers]}
        for name, numbers in known
        if truth.get(name) not in (None, "", NONE)
    ]
    Ts = float(baseline["sampling"]["Ts"])
    plan = planned(trial, float(baseline.get("noise", {}).get("std", 0.0)))
    seed = int(truth["seed"]) + _SEED + ORDER.index(trial.id)
    columns = load_world(truth["world"]).test(truth, acts, seed, plan)
    record = place / f"{truth['id']}-{trial.id}.csv"
    write_whole(record.with_suffix(".toml"), settings_toml(plan.settings(Ts)))
    write_whole(record, csv_of(columns))
    return record
