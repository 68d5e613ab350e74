"""Translate the mode of a controller, sample by sample, from the words and numbers of control
systems to AUTO, MAN or CAS.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from simbench.detectors.records.dialects import entries

AUTO = "AUTO"
MAN = "MAN"
CAS = "CAS"
_WORDS = {
    AUTO: """
        auto, aut, a, automatic, automatik, automatisch, automatique, automatico,
        automatica, true, on, lsp, local, closed, 自动, 自動
    """,
    MAN: """
        man, m, manual, hand, manuell, manuel, manuelle, manu, false, off, iman, init, lo,
        oos, rout, trk, track, tracking, open, out of service, 手动, 手動
    """,
    CAS: """
        cas, c, casc, cascade, kaskade, cascada, cascata, rcas, bcas, rsp, remote, 串级, 串級
    """,
}
_MEANS = {word: mode for mode, among in _WORDS.items() for word in entries(among)}
# Foundation Fieldbus writes one bit per mode; elsewhere 0, 1 and 2 count up from manual (Honeywell,
# PCS 7, Modbus faceplates)
_FIELDBUS = {128: MAN, 64: MAN, 32: MAN, 16: MAN, 8: AUTO, 4: CAS, 2: CAS, 1: MAN}
_COUNTED = {0: MAN, 1: AUTO, 2: CAS, 3: CAS}


def mode(cells: Sequence[object] | np.ndarray) -> np.ndarray:
    """Return AUTO, MAN or CAS of every cell, "" where it is empty or not understood."""
    texts = ["" if c is None or c != c else str(c).strip().lower() for c in cells]
    kinds = {text: _number(text) for text in set(texts)}
    numbers = {k for k in kinds.values() if k is not None}
    codes = _COUNTED if numbers <= set(_COUNTED) else _FIELDBUS
    means = {text: codes.get(k, "") if k is not None else _word(text) for text, k in kinds.items()}
    return np.array([means[text] for text in texts], dtype="<U4")


def _number(text: str) -> int | None:
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        return None
    return int(value) if value == int(value) else -1


def _word(text: str) -> str:
    # "AUT.", "AUTO-INIT" and "P-AUTO" mean a controller in automatic
    return _MEANS.get(text) or next(
        (_MEANS[w] for w in text.replace("-", " ").replace(".", " ").split() if w in _MEANS), ""
    )
