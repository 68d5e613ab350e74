"""A folder of records as someone else would send it."""

import numpy as np
import pandas as pd
import pytest

BASELINE = """[plant]
type = "foptd"
K = 1.0
T = 5.0
[controller]
type = "PI"
Kc = 1.0
Ti = 5.0
[sampling]
Ts = 1.0
"""


@pytest.fixture
def theirs(tmp_path):
    """Three records, other column case, plain answers without strengths."""
    folder, rng = tmp_path / "theirs", np.random.default_rng(0)
    (folder / "records").mkdir(parents=True)
    for name in "abc":
        op, pv = rng.standard_normal((2, 50))
        frame = pd.DataFrame({"T_s": np.arange(50.0), "SP": 1.0, "OP": 50 + op, "PV": pv})
        frame.to_csv(folder / "records" / f"{name}.csv", index=False)
        (folder / "records" / f"{name}.toml").write_text(BASELINE)
    (folder / "answers.csv").write_text(
        "ID,Block,Effect\na,valve,stiction\nb,none,none\nc,valve,broken_spring\n"
    )
    return folder
