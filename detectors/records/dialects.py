"""The words by which tables name what they hold: small letters, spaces between them. To read
another system's export, add its words.
"""

from __future__ import annotations


def entries(table: str) -> tuple[str, ...]:
    """Return the entries of a text that commas separate."""
    return tuple(filter(None, " ".join(table.split()).split(", ")))


# the signals; what a row is about: its time, which `date` and `clock` may make together, the `tag`
# of its loop, `value` and `quality`; and what a quality means
_NAMES = {
    what: entries(text)
    for what, text in {
        "time": """
            t s, t, time, timestamp, ts, datetime, date time, date, time stamp, time string,
            date and time, elapsed, elapsed time, ip trend time, t stamp, last changed, last updated
        """,
        "date": "date",
        "clock": "time",
        "tag": """
            tag, tagname, tag name, point, point name, pointname, variable, name, varname, var name,
            item, itemid, item id, node id, nodeid, object, path, tag path, series, metric,
            measurement, entity, entity id, loop, loop tag, loop name, loop id
        """,
        "value": "value, val, ip trend value, varvalue, var value, state",
        "quality": """
            quality, quality code, data quality, quality detail, qualitydetail, opcquality,
            opc quality, qc, qlevel, qstatus, status, qual, validity, confidence, good, bad
        """,
        "good": "good, g, ok, valid, true",
        "bad": "bad, b, invalid, false",
        "unsure": "uncertain, questionable, doubtful, u, q, substituted, annotated",
        "pv": "pv, measured value, process value, process variable, measurement, pv in, meas",
        "op": "op, out, output, co, controller output, control output, lmn",
        # beside SV, the MV of Yokogawa is the controller's output, see `roles.find_loops`
        "sp": "sp, setpoint, set point, setpt, sv, spt",
        "mv": """
            mv, valve position, position, pos, valve pos, travel, valve travel, stem position
        """,
        "mode": "mode, controller mode",
    }.items()
}


def words(what: str) -> tuple[str, ...]:
    """Return the words for what a table holds, such as "pv"."""
    return _NAMES[what]
