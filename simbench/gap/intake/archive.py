"""Find what the archive changed between the PV that the controller saw and the PV on record:
rounding, compression, averages and spikes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simbench.detectors.signal.holds import on_line
from simbench.detectors.signal.lattice import hides_nothing
from simbench.detectors.signal.spikes import cleaned, find_spikes
from simbench.gap.controller.law import EXACT
from simbench.gap.situation import Archive, Seen
from simbench.gap.thresholds import ORDINARY_CARD
from simbench.loop.controller import derivative_filter
from simbench.scenarios.parts import Part

# share of samples on a line through their neighbours; exceptions of a quarter of the noise leave
# fewer
_STRAIGHT = 0.17
# of the variance of PV's moves, that an archive may differ from what the controller saw: without
# it OP is said to move as no PV makes it in three of 164 records
_SPECKS = 0.02
# share of OP's moves that a PID leaves whose derivative is computed two to five times within a
# sample (.25 to .61 in five records of a simulator): the archive cannot tell it
_FASTER = 0.7
_FADED = 4.0  # time constants, after which 2 % are left
_DECIMAL = 0.1  # % of OP, in which it is often written
_ROUND = 1e-6  # share, by which a step read off may be off
_STRAYS = 3  # samples in which an exact law fails, from which something else moves OP too


def why_no_law(s: Seen, archive: Archive, mismatch: str) -> str:
    """Return why no PI law explains the recorded OP; nothing if the archive explains the
    difference.
    """
    if not archive.faithful or s.law.gap > 0.0:
        return mismatch
    quick = s.baseline.controller.Td and EXACT < s.law.residual < _FASTER
    return mismatch or s.law.foreign or ("" if quick else s.law.reason or _op_strays(s))


def _op_strays(s: Seen) -> str:
    """Return that OP strays from a law which holds exactly elsewhere, but for the set point, ends
    and samples not archived.
    """
    if s.law.limits is not None or s.law.step > 0.0:
        return ""
    marked = np.append(True, np.diff(s.sp) != 0.0) | on_line(s.record.pv, s.samples.digits)
    if s.law.hidden > 0.0:
        # what an archive by exception repeats is not what the controller saw or wrote
        marked[1:] |= (np.diff(s.op) == 0.0) | (np.diff(s.record.pv) == 0.0)

    # an end of OP's range is everybody's
    marked |= np.isin(s.op, (s.op.min(), s.op.max()))

    # what one sample does to a derivative fades with its filter
    c = s.baseline.controller
    fades = int(np.ceil(_FADED * (c.Td or 0.0) / (derivative_filter(c) * s.record.Ts)))
    excused = np.convolve(marked, np.ones(5 + 2 * fades), "same") > 0.0
    count = int(np.count_nonzero(~excused[s.law.strays]))
    if count >= _STRAYS:
        return f"OP strays from a law that holds elsewhere, in {count} samples"
    return ""


def with_card(s: Seen, archive: Archive) -> Seen:
    """Return a record beside its baseline with the lattices of PV and OP in it, where a card or the
    digits of an archive are no coarser: what any plant has is in every simulation, and no gap.
    """
    if not s.trusted:
        return s
    stated = {part.name for part in s.baseline.effect}
    cards = []
    if archive.rounding is not None and archive.rounding[0] <= ORDINARY_CARD * s.noise:
        step, at = archive.rounding
        cards.append(Part(name="quantisation", parameters={"step": step, "at": at}))
    if abs(s.law.step - _DECIMAL) < _ROUND * _DECIMAL:
        cards.append(Part(name="op_quantisation", parameters={"step": _DECIMAL}))
    cards = [card for card in cards if card.name not in stated]
    return replace(s, baseline=s.baseline.replace(effect=s.baseline.effect + tuple(cards)))


def find_archive(s: Seen) -> tuple[Archive, np.ndarray, str]:
    """Return what single samples prove of PV, the PV the controller saw, and why OP moves as no PV
    makes it move.
    """
    # What the law says of PV, and where the archive stands
    law = s.law
    samples = s.samples
    pv = s.record.pv
    seen = law.recovered_pv
    place = "record" if law.apart else "loop"

    # A lattice, straight lines, or the file's decimals
    band = 0.0
    step = 0.0
    if samples.step > 0.0 and not hides_nothing(samples.step, pv):
        step = samples.step
    # noise that an archive's mean has smoothed lies on lines sooner
    elif samples.straight > _STRAIGHT and not law.averaged:
        if seen is None:
            size = 0.0
        else:
            size = float(np.quantile(np.abs(pv - seen), 0.98))
        band = size or 0.5 * float(np.std(np.diff(pv)))
    elif not hides_nothing(samples.digits, pv, s.noise):
        step = samples.digits

    # a mean over a sample is the archive's and no effect: the controller saw PV
    hidden = seen is not None and (law.averaged or (law.apart and (step or band)))
    plant_pv = seen if hidden else pv
    spikes, plant_pv, mismatch = _find_spikes(s, plant_pv, band > 0.0 or law.averaged)
    return Archive((step, place) if step else None, band, spikes), plant_pv, mismatch


def _find_spikes(
    s: Seen, plant_pv: np.ndarray, thinned: bool
) -> tuple[tuple[float, float, str] | None, np.ndarray, str]:
    """Return spikes as `Archive` has them, PV without those the plant did not make, and why OP
    moves as no PV makes it.
    """
    # Spikes as the samples show them
    law = s.law
    samples = s.samples
    pv = s.record.pv
    seen = law.recovered_pv
    mismatch = ""
    spikes = samples.spikes
    heights = samples.heights
    place = "loop"

    # Against the PV that the law recovers: what is left are spikes alone, or OP strays
    if seen is not None and not law.foreign and not thinned:
        only, sizes = find_spikes(pv - seen, 0.0)
        # where the law is exact everywhere else, what is left of PV is the spikes alone
        strong = np.abs(sizes) > max(1e-3 * float(np.std(pv)), 5.0 * law.blur)
        only = only[strong]
        sizes = sizes[strong]
        plain = only.size >= 2 and samples.step == 0.0
        # an archive lost some samples, which were bridged, of OP as well
        if plain and np.all(_find_bridged(pv, samples.digits)[only]):
            return None, seen, ""
        if plain and not stands_out(pv, only, sizes):
            # or drops the samples least missed
            if np.var(pv - seen) < _SPECKS * float(np.var(np.diff(pv))):
                return None, seen, ""
            mismatch = "OP moves as no PV on record makes it move"
        elif plain:
            spikes = only
            heights = sizes
            place = "record"
            plant_pv = seen
    elif spikes.size >= 3 and seen is None and not _op_answers_spikes(s, spikes, heights):
        place = "record"

    # Too few are none; the plant did not make those of the archive
    if spikes.size < 3 or thinned:
        return None, plant_pv, mismatch
    if place == "loop" or seen is None:
        plant_pv = cleaned(plant_pv, spikes)
    return (spikes.size / pv.size, float(np.mean(np.abs(heights))), place), plant_pv, mismatch


def _find_bridged(pv: np.ndarray, digits: float) -> np.ndarray:
    """Return the samples (n,) on straight lines, and those beside them."""
    return np.convolve(on_line(pv, digits), np.ones(3), "same") > 0.0


def _op_answers_spikes(s: Seen, spikes: np.ndarray, heights: np.ndarray) -> bool:
    """Return whether OP jumps with the spikes of PV as the controller gain requires."""
    du = np.append(np.diff(s.record.op), 0.0)[np.clip(spikes - 1 + s.law.late, 0, s.record.n - 1)]
    asked = -s.law.Kc * heights
    return float(du @ asked) > 0.5 * float(asked @ asked)


def stands_out(pv: np.ndarray, places: np.ndarray, heights: np.ndarray) -> bool:
    """Return whether spikes that the controller did not see stand out of their neighbours in PV by
    just their height.
    """
    inner = (places > 0) & (places < pv.size - 1)
    k = places[inner]
    h = heights[inner]
    if k.size < 2:
        return False
    off = pv[k] - 0.5 * (pv[k - 1] + pv[k + 1])
    return float(np.median(np.abs(off - h))) < 0.5 * float(np.median(np.abs(h)))
