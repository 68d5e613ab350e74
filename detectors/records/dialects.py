"""The words by which control systems, historians and languages name what a table holds: one row
each. To read another system's export, add its words to a row, or a row.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache


@dataclass(frozen=True)
class Dialect:
    """One row: words in small letters without accents, separated by commas.

    `tag` and `value` name the columns of a table with a row per time and tag, which is refused;
    `date` and `clock` are columns that are a time together; `good`, `bad` and `unsure` say what a
    quality means.
    """

    name: str
    time: str = ""
    date: str = ""
    clock: str = ""
    tag: str = ""
    value: str = ""
    quality: str = ""
    good: str = ""
    bad: str = ""
    unsure: str = ""
    pv: str = ""
    op: str = ""
    sp: str = ""
    mv: str = ""
    mode: str = ""


DIALECTS = (
    Dialect(
        "standard terms",
        time="""
            t s, t, time, timestamp, ts, datetime, date time, date, time stamp, time string,
            date and time, elapsed, elapsed time
        """,
        date="date",
        clock="time",
        tag="""
            tag, tagname, tag name, point, variable, name, item, object, path, series, loop,
            loop tag, loop name, loop id
        """,
        value="value, val",
        quality="quality, quality code, data quality, status, qual, validity, good, bad",
        good="good, g, ok, valid, true",
        bad="bad, b, invalid, false",
        unsure="uncertain, questionable, doubtful, u, q, substituted, annotated",
        pv="""
            pv, measured value, process value, process variable, measurement
        """,
        op="op, out, output, co, controller output, control output",
        sp="sp, setpoint, set point, setpt",
        mv="""
            mv, valve position, position, pos, valve pos, travel, valve travel, stem position
        """,
        mode="mode, controller mode",
    ),
    Dialect("AVEVA PI", tag="point name, pointname, data source, tag path"),
    Dialect(
        "AspenTech IP.21",
        time="ip trend time",
        value="ip trend value",
        quality="qlevel, qstatus",
    ),
    Dialect("Wonderware", quality="opcquality, opc quality, quality detail, qualitydetail, qc"),
    Dialect("Ignition", time="t stamp"),
    Dialect("Honeywell", quality="confidence"),
    # its MV beside SV is the controller's output, see `roles.find_loops`
    Dialect("Yokogawa", sp="sv"),
    Dialect(
        "Siemens",
        tag="varname, var name",
        value="varvalue, var value",
        pv="pv in",
        op="lmn",
    ),
    Dialect("Foxboro", pv="meas", sp="spt"),
    Dialect("OPC", tag="itemid, item id, node id, nodeid"),
    Dialect(
        "InfluxDB, Home Assistant",
        time="last changed, last updated",
        tag="measurement, metric, entity id, entity",
        value="state",
    ),
    Dialect(
        "German",
        time="zeitstempel, zeit, zeitpunkt, datum, datum uhrzeit, uhrzeit, datum zeit",
        date="datum",
        clock="uhrzeit, zeit",
        tag="messstelle",
        value="wert, messwert",
        quality="qualitat, qualitaet",
        good="gut",
        bad="schlecht",
        unsure="unsicher",
        pv="istwert, ist, regelgrosse, regelgroesse",
        op="""
            stellgrosse, stellgroesse, stellwert, stellsignal, reglerausgang, ausgang
        """,
        sp="sollwert, soll, fuhrungsgrosse, fuehrungsgroesse",
        mv="ventilstellung, stellungsruckmeldung, ruckmeldung, rueckmeldung",
        mode="modus, betriebsart",
    ),
    Dialect(
        "French",
        time="horodatage, date heure, heure, temps",
        clock="heure",
        tag="repere",
        value="valeur",
        quality="qualite",
        good="bon, bonne",
        bad="mauvais, mauvaise",
        unsure="incertain",
        pv="mesure, valeur mesuree",
        op="sortie, sortie regulateur, commande",
        sp="consigne",
        mv="position vanne",
    ),
    Dialect(
        "Spanish and Italian",
        time="marca de tiempo, fecha hora, fecha y hora, fecha, hora, tiempo, ora",
        date="fecha",
        clock="hora, ora",
        tag="etiqueta, nombre",
        value="valor",
        quality="calidad, qualita",
        good="buena, bueno, buono",
        bad="mala, malo, cattivo",
        pv="""
            medida, medicion, valor medido, valor de proceso, variable de proceso, misura
        """,
        op="salida, salida del controlador, salida controlador, uscita",
        sp="consigna, punto de consigna",
        mv="posicion valvula, posicion de valvula",
        mode="modo",
    ),
    Dialect(
        "Chinese",
        time="时间戳, 时间, 日期时间, 日期",
        date="日期",
        clock="时间",
        tag="标签, 标签名, 位号, 点名",
        value="值, 数值",
        quality="质量, 状态",
        good="好, 良好, 正常",
        bad="坏, 差, 错误",
        unsure="不确定",
        pv="测量值, 测量, 过程值, 过程变量, 实际值, 被控变量",
        op="输出, 输出值, 控制器输出, 控制输出, 阀位指令, 阀门开度指令",
        sp="设定值, 设定, 给定值, 给定",
        mv="阀位反馈, 阀位, 阀门开度",
        mode="模式",
    ),
)


@cache
def words(what: str) -> tuple[str, ...]:
    """Return the words of all dialects for a role, such as "pv", in the order of the table."""
    return tuple(
        dict.fromkeys(word for dialect in DIALECTS for word in entries(getattr(dialect, what)))
    )


def entries(table: str) -> tuple[str, ...]:
    """Return the entries of a text that commas separate."""
    return tuple(filter(None, " ".join(table.split()).split(", ")))
