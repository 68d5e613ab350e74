"""Find recorded loops by the chapter's names (CHEM1, PAP2, ...) in an ISDB file or a folder of
records.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from simbench.detectors.errors import UserError
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.io import read_record
from simbench.detectors.records.matlab import read_loops
from simbench.detectors.signal.conditioning import band
from simbench.detectors.signal.oscillation import find_oscillation

# ISDB's sectors by the letters that the chapter's loop names begin with
_SECTORS = {
    "CHEM": "chemicals",
    "PAP": "pulpPapers",
    "POW": "power",
    "MIN": "mining",
    "MET": "metals",
    "BAS": "buildings",
}


class NeedsRecord(UserError):
    """A real loop that a figure shows and that the given data do not hold."""


def real_loop(isdb: str | Path, name: str, **about: str) -> LoopRecord:
    """Read one real loop."""
    # A folder of records: the file of that name
    path = Path(isdb)
    if path.is_dir():
        for stem in (name, f"ISDB_{name}"):
            matches = []
            for f in sorted(path.glob(f"{stem}.*")):
                if f.suffix in (".csv", ".txt", ".parquet", ".xlsx"):
                    matches.append(f)
            if matches:
                return replace(read_record(matches[0], **about), tag=name)
    else:
        # A .mat file: the loop of that sector and number
        letters = name.rstrip("0123456789")
        wanted = f"{_SECTORS.get(letters, letters)}.loop{name[len(letters) :]}".lower()
        matches = []
        for loop in read_loops(path):
            if loop.lower() == wanted:
                matches.append(loop)
        if matches:
            return replace(read_record(path, tag=matches[0], **about), tag=name)
    raise NeedsRecord(f"needs ISDB loop {name}; {path} does not hold it")


def filter_record(record: LoopRecord) -> tuple[np.ndarray, np.ndarray, float]:
    """Return OP and PV filtered around the record's oscillation, as detectors see them, and its
    period in samples.
    """
    period = find_oscillation(record.op, record.pv, record.Ts).period_s / record.Ts
    return band(record.op, period, 3), band(record.pv, period, 3), period
