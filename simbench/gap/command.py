"""Run the gap diagnosis on files: read records and a loop file, write the report, its page and the
corrected loop file.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simbench.detectors.errors import ParameterError, RecordError, printable
from simbench.detectors.record import LoopRecord
from simbench.detectors.records.folder import read_labels
from simbench.detectors.records.io import read_record
from simbench.files import picture_kind, refuse_own_input, whole_file
from simbench.gap.diagnosis import diagnose
from simbench.gap.intake.partial import read_baseline
from simbench.gap.report.result import GapReport
from simbench.loop.effects import EFFECTS, PLUGINS
from simbench.scenarios.columns import in_a_file
from simbench.scenarios.toml import toml_of
from simbench.usage import plain_number

if TYPE_CHECKING:
    from simbench.gap.benchmark.result import GridGap


@dataclass(frozen=True)
class DiagnosisFiles:
    """Files that a diagnosis writes: its page, the loop file with the effect in it, its picture."""

    html: str | Path | None = None
    write_loop: str | Path | None = None
    picture: str | Path | None = None


def diagnose_files(
    records: Sequence[str | Path],
    baseline: str | Path | None,
    *,
    jobs: int = 1,
    wanted: DiagnosisFiles = DiagnosisFiles(),
    window: tuple[int, int] | None = None,
    effect_plugins: Sequence[str | Path] = (),
    healthy: Sequence[str | Path] = (),
    **about: Any,
) -> GapReport:
    """Diagnose the records of one loop with its loop file.

    Parameters
    ----------
    records : sequence of str or Path
        Files of one loop's records.
    baseline : str, Path or None
        Loop file of the simulation; None identifies the loop from the record.
    jobs : int
        Processes, where there are several records.
    wanted : DiagnosisFiles
        Files to write.
    window : (int, int), optional
        First sample that is judged, and the one after the last.
    effect_plugins : sequence of str or Path
        Files of further effects.
    healthy : sequence of str or Path
        Records of the same loop, or of its siblings, from healthy operation.
    **about
        What is known of the records, as in `read_record`.

    Returns
    -------
    GapReport
        The diagnosis; the files that `wanted` names are written.

    Raises
    ------
    UserError
        For files that cannot be read or compared, in one sentence.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> import simbench as sb
    >>> from simbench.files import write_record
    >>> place = pathlib.Path(tempfile.mkdtemp())
    >>> loop = sb.Loop(
    ...     plant={"type": "foptd", "K": 1.5, "T": 20.0, "Td": 3.5},
    ...     controller={"type": "PI", "Kc": 0.6, "Ti": 18.0},
    ...     noise={"std": 0.1}, setpoint={"value": 50.0, "steps": [[60.0, 53.0]]},
    ...     sampling={"Ts": 1.0, "n": 600},
    ... )
    >>> write_record(loop.with_("controller.Kc", 1.6).simulate(1).record, place / "FIC101.csv")
    >>> _ = (place / "loop.toml").write_text(loop.to_toml())
    >>> diagnose_files([place / "FIC101.csv"], place / "loop.toml").block
    'controller'
    """
    if not records:
        raise ParameterError("gap diagnose needs at least one record")
    if wanted.write_loop is None:
        beside = None
    else:
        beside = columns_beside(Path(wanted.write_loop))
    refuse_own_input(
        [wanted.html, wanted.write_loop, beside, wanted.picture],
        list(records) + [baseline] + list(healthy),
    )
    if wanted.picture is not None:
        picture_kind(wanted.picture)
    if baseline is None:
        loop = None
    else:
        loop = read_baseline(baseline)
    read = [_read_window(path, window, about) for path in records]
    ordinary = [_read_window(path, None, about) for path in healthy]
    if len(read) > 1:
        source = read
    else:
        source = read[0]
    with effects_known(effect_plugins):
        # other processes do not know them
        jobs = 1 if effect_plugins else jobs
        report = diagnose(source, loop, healthy=ordinary, jobs=jobs)
        # what reading the records assumed
        assumed = []
        for record in read:
            for note in record.notes:
                assumed.append(note)
        report = replace(report, notes=tuple(dict.fromkeys(list(report.notes) + assumed)))
        if wanted.write_loop is not None:
            _write_loop(report, Path(wanted.write_loop), [str(p) for p in records], baseline)
        if wanted.picture is not None:
            from simbench.gap.report.view import draw_sheet
            from simbench.page.style import write_picture

            write_picture(draw_sheet(report), wanted.picture)
        if wanted.html is not None:
            from simbench.gap.report.view import write_page

            options = {
                **about,
                "window": window,
                "effect-plugin": list(effect_plugins),
                "healthy": list(healthy),
            }
            write_page(report, wanted.html, _commands_to_repeat(report, records, baseline, options))
    return report


def grid_files(
    grid: str,
    folder: str | Path,
    *,
    labels: str | Path | None = None,
    picture: str | Path | None = None,
    **options: Any,
) -> GridGap:
    """Return how a grid differs from the records of a folder; a table of labels states their
    units.
    """
    # here, for it loads the benchmark
    from simbench.gap.benchmark.measure import grid as grid_gap
    from simbench.page.style import write_picture

    refuse_own_input([picture], [folder, labels])
    if picture is not None:
        picture_kind(picture)
    if labels is None:
        table = {}
    else:
        table = read_labels(labels)
    units = {}
    for name, row in table.items():
        units[name] = row["unit_group"]
    found = grid_gap(grid, folder, units=units, **options)
    if picture is not None:
        write_picture(found.plot(), picture)
    return found


@contextmanager
def effects_known(files: Iterable[str | Path]) -> Iterator[None]:
    """Make the effects in these files known while the block lasts, so that a loop file may name
    them. They run in this process, as the user asked.
    """
    with ExitStack() as stack:
        for file in files:
            name = PLUGINS.add_file(file)
            stack.callback(EFFECTS.forget_all)
            stack.callback(PLUGINS.forget, name)
        EFFECTS.forget_all()
        yield


def _read_window(
    path: str | Path, window: tuple[int, int] | None, about: Mapping[str, Any]
) -> LoopRecord:
    record = _cut_window(read_record(path, automatic=False, **about), window, path)
    if record.op_share:
        raise RecordError(
            f"{path}: OP runs from {record.op.min():g} to {record.op.max():g}, which is not % of"
            " travel; --op-span, what means 0 and 100 %, is needed"
        )
    return record


def _cut_window(record: LoopRecord, window: tuple[int, int] | None, path: str | Path) -> LoopRecord:
    if window is None:
        return record
    first, last = window
    if not 0 <= first < last <= record.n:
        raise ParameterError(
            f"{path}: --window {first} {last}; samples FROM < TO within 0..{record.n} are needed"
        )
    cut = record.window(first, last)
    manual = record.meta.get("manual")
    if manual is None:
        return cut
    return replace(cut, meta={**cut.meta, "manual": manual[first:last]})


def columns_beside(loop: Path) -> Path:
    """Return the file beside a loop file that holds its columns of residuals and held samples."""
    return loop.with_name(f"{loop.stem}.columns.csv")


def _write_loop(
    report: GapReport, path: Path, records: list[str], baseline: str | Path | None
) -> None:
    """Write the loop of a report, and its columns beside it where it has some."""
    beside = columns_beside(path)
    table, columns = in_a_file(report.fixed_loop().to_table(), beside.name)
    if columns:
        with whole_file(beside) as f:
            f.write(columns)
    with whole_file(path) as f:
        f.write(_heading_of_loop(report, records, baseline) + _with_comments(table))


_SAYS = {
    "plant": "as fitted to the record",
    "controller": "the baseline's, or as the record shows it",
    "sampling": "as long as the record",
    "operating_point": "where OP and PV rest before the run, at the record's level",
    "noise": "white noise of PV, as fitted to the record",
    "setpoint": "the record's set point: times in s, and values",
    "archive": "how the record is written: the controller does not see it",
    "ramp": "moves OP in its first sample, which starts the cycle of a valve at rest",
    "coloured": "a load, or noise with a memory, as fitted to the record",
    "resampled": "the load, drawn again in pieces from what the record left",
}


def _with_comments(table: Mapping[str, Any]) -> str:
    """Return a loop's table as the text of a loop file, above each part what it is for."""
    # Each part of each section
    parts = []
    for section, content in table.items():
        for one in content if isinstance(content, list) else [content]:
            kind = str(one.get("name") or one.get("type"))

            # What it is for, by its section or its kind
            if section == "effect" and kind in EFFECTS:
                of_effect = EFFECTS[kind].says
            else:
                of_effect = ""
            says = _SAYS.get(section) or of_effect or _SAYS.get(kind, "")
            if says:
                said = f"# {says}\n"
            else:
                said = ""
            parts.append(said + toml_of({section: [one] if isinstance(content, list) else one}))
    return "\n".join(parts)


def _heading_of_loop(report: GapReport, records: list[str], baseline: str | Path | None) -> str:
    """Return what stands above a written loop, as comments."""
    lines = (
        [report.sentence()]
        + report.identified()
        + [
            f"records: {', '.join(records)}; baseline: {baseline or 'identified'}",
            "set point and length are the record's, load and operating point fitted to it",
        ]
    )
    # a name may hold a line break, which would end the comment, or what TOML allows nowhere
    return "".join(f"# {printable(' '.join(line.split()))}\n" for line in lines) + "\n"


def _commands_to_repeat(
    report: GapReport,
    records: Sequence[str | Path],
    baseline: str | Path | None,
    about: dict[str, Any],
) -> list[str]:
    """Return the commands that repeat a diagnosis and simulate the fixed loop."""
    # The command itself, with the loop file or without
    words = ["simbench", "gap", "diagnose", *map(str, records)]
    if baseline is None:
        words += ["--identify"]
    else:
        words += ["--baseline", str(baseline)]

    # Every option that was given, in the form of the command line
    for name, value in about.items():
        if isinstance(value, dict):
            value = ",".join(f"{role}={column}" for role, column in value.items())
        for one in value if isinstance(value, list) else [] if value is None else [value]:
            if isinstance(one, tuple):
                numbers = one
            elif one is True:
                numbers = ()
            else:
                numbers = (one,)
            words += [f"--{name.replace('_', '-').lower()}", *map(plain_number, numbers)]

    # And the simulation of what it wrote
    words += ["--write-loop", "fixed.toml"]
    return [shlex.join(words), "simbench simulate fixed.toml -o fixed.csv"]
