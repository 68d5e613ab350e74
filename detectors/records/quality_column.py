"""Which samples a column of quality calls bad: codes of OPC, words, or a flag."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.records.dialects import words
from simbench.detectors.records.roles import QUALITY_OF, is_quality, parse, plain, quality_of
from simbench.detectors.records.tables import Sheet

GOOD, BAD, UNSURE = (set(words(what)) for what in ("good", "bad", "unsure"))
# where a historian writes several, these have one meaning
_FIXED_MEANING = ("opcquality", "qstatus", "qlevel")
# the number of a bad sample in a column of yes and no, or of a share, by the last word of its name
_FLAGS = {"validity": 0, "confidence": 0, "good": 0, "qlevel": 0, "bad": 1}
# a historian's mark after a value: 119.9 ?, 119.9 (Q), 119.9*, 119.9 [Bad], 119.9 Q
MARKS = GOOD | BAD | UNSURE


def apply_quality(
    sheet: Sheet,
    roles: Mapping[str, str],
    signals: Mapping[str, np.ndarray],
    where: str,
    chosen: Mapping[str, str],
) -> None:
    """Blank the samples that a quality column calls bad; of several about one signal, by the one of
    known meaning.
    """
    asked = chosen.get(QUALITY_OF, "")
    if asked.lower() == "none":
        return
    names = [n for n in sheet.columns if n not in roles.values()]
    names = [n for n in names if (n == asked if asked else is_quality(n))]
    known = [n for n in names if _last_word(n) in _FIXED_MEANING]
    for name in names:
        mine = [role for role in signals if _is_about(name, roles[role], role, sheet, roles)]
        if name not in known and any(
            _is_about(other, roles[role], role, sheet, roles) for other in known for role in mine
        ):
            continue
        judged = _find_bad(sheet.columns[name], name, where) if mine else None
        if judged is None:
            what = [f"column {name!r} is not understood and counts for nothing"] if mine else []
        else:
            bad, unsure = judged
            for role in mine if bad.any() else ():
                signals[role][bad] = np.nan
            counts = ((int(bad.sum()), "bad count as missing"), (unsure, "uncertain are kept"))
            what = [f"{n} samples that {name!r} calls {which}" for n, which in counts if n]
        sheet.notes += [f"quality: {sentence}" for sentence in what]


def _is_about(name: str, column: str, role: str, sheet: Sheet, roles: Mapping[str, str]) -> bool:
    """Whether a quality speaks of a signal: it stands next to its column where several have one
    name, or names its column, its loop or the signal, or nothing.
    """
    names = list(sheet.columns)
    alike = [n for n in names if is_quality(n) and _strip_number(n) == _strip_number(name)]
    if len(alike) > 1:
        side = -1 if names[names.index(alike[0]) - 1] in roles.values() else 1
        return names[(names.index(name) + side) % len(names)] == column
    whose = quality_of(name) or []
    named = parse(".".join(whose))
    mine = parse(column)
    if named.role:
        return named.role == role and named.loop in ((), mine.loop)
    return not whose or tuple(whose) == mine.loop


def _strip_number(name: str) -> str:
    return re.sub(r"\.\d+$", "", name)


def _last_word(name: str) -> str:
    return plain(_strip_number(name)).replace("_", " ").split()[-1]


def _find_bad(cells: Sequence[object], name: str, where: str) -> tuple[np.ndarray, int] | None:
    """Return which samples are bad and how many unsure, by the codes of OPC, by words or by a flag;
    None where the column speaks of no quality.
    """
    texts = ["" if c is None or c != c else plain(c) for c in cells]
    means = {t: _word(t) for t in set(texts)}
    said = {m for t, m in means.items() if t}
    last = _last_word(name)
    numbers = {m for m in said if isinstance(m, int)}
    if said and said == numbers:
        codes = np.array([192 if t == "" else means[t] for t in texts], dtype=int)
        most = max(numbers)
        if last in _FLAGS and (most <= 1 or last in ("validity", "confidence")):
            return codes == _FLAGS[last], 0
        if most < 192 and most != 128:  # which PCS 7 writes for good
            raise RecordError(
                f"{where}: quality {name!r} holds {min(numbers)}; 0 to 255 with 192 as good is"
                " known, or words",
                "--columns quality=none",
            )
        codes &= 255  # OPC UA and historians keep more above the lowest byte
        return codes < 64, int(((codes >= 64) & (codes < 192)).sum())
    odd = sorted(t for t, m in means.items() if t and m not in MARKS)
    if odd and len(odd) < len(said):
        sentence = f"{where}: quality {name!r} says {odd[0]!r}; known: good, bad, uncertain"
        raise RecordError(sentence, "--columns quality=none")
    if odd:
        return None
    # a flag named Bad is true where the sample is bad
    flagged = GOOD if last == "bad" else BAD
    bad = np.array([means[t] in flagged for t in texts], dtype=bool)
    return bad, sum(means[t] in UNSURE for t in texts)


def _word(text: str) -> str | int:
    """Return the code in a cell of quality, or its first word: "Good, Non-specific", "192
    (Good)".
    """
    code = re.match(r"\d+(?=(\.0)?(\s*[(\[].*)?$)", text)
    if code:
        return int(code[0])
    return re.split(r"[\s,;:(\[_-]", text, maxsplit=1)[0]
