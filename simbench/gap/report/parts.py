"""What the pages of a diagnosis and of a discovery share: the record beside its simulations."""

from __future__ import annotations

from simbench.gap.report.pictures import Traces, draw_loops, draw_spectra, draw_traces
from simbench.gap.report.traces import end_of
from simbench.gap.situation import Situation
from simbench.html.document import Part, Pictures, Text


def look(traces: Traces, situation: Situation) -> list[Part]:
    """Return the record and its simulations in pictures: over time, over OP, and their spectra."""
    part, shown = end_of(situation), "record and simulations"
    drawn = [
        (draw_traces("PV", traces, part), f"PV over time, set point dotted: {shown}"),
        (draw_traces("OP", traces, part), f"OP over time: {shown}"),
        (draw_loops("PV", traces, part), f"PV over OP: {shown}"),
        (draw_spectra(traces), "Power spectra of PV and OP, whole record"),
    ]
    if all(trace.mv is not None for trace in traces.values()):
        drawn.append((draw_loops("MV", traces, part), f"MV over OP: {shown}"))
    given = "given" if situation.trusted else "identified from the record"
    added = "".join(f", and {name} added" for name in traces if name.startswith("with "))
    lost = "" if "baseline" in traces else " The baseline runs away and is not drawn."
    says = (
        "The record beside simulations of the same length under its set point: the baseline as"
        f" {given}, the baseline with K, T and Td recalibrated{added}. Same axes; time plots show"
        " the end of the part on which nothing was fitted. Loads and noise are drawn at random, so"
        f" shape, size and period should agree, not the phase.{lost}"
    )
    return [Text(says), Pictures(drawn)]
