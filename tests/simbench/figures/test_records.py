"""Real loops are read by the chapter's names in a folder and in an ISDB file alike."""

import numpy as np
import pytest
from scipy.io import savemat

from simbench.figures._records import NeedsRecord, real_loop

K = np.arange(100)
OP, PV = 50.0 + 3.0 * np.sin(K / 5), 50.0 - 2.0 * np.sin(K / 5 - 1)


def test_a_loop_is_read_by_its_name_from_a_folder_and_from_an_isdb_file(tmp_path):
    file = tmp_path / "isdb.mat"
    other = {"PV": OP, "OP": PV, "SP": 0.0 * PV, "Ts": 1.0}
    savemat(
        file,
        {
            "cdata": {
                "pulpPapers": {
                    "loop1": other,
                    "loop2": {"PV": PV, "OP": OP, "SP": 0.0 * PV, "Ts": 1.0},
                }
            }
        },
    )
    rows = "".join(
        f"{k},{op!r},{pv!r}\n"
        for k, op, pv in zip(K.tolist(), OP.tolist(), PV.tolist(), strict=True)
    )
    (tmp_path / "ISDB_PAP2.csv").write_text("t_s,op,pv\n" + rows)
    for isdb in (file, tmp_path):
        record = real_loop(isdb, "PAP2", kind="flow")
        assert (record.tag, record.kind) == ("PAP2", "flow")
        assert np.allclose(record.pv, PV)
        with pytest.raises(NeedsRecord, match="PAP3"):
            real_loop(isdb, "PAP3")
