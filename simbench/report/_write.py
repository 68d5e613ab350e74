"""Write the report of a run as one self-contained HTML file."""

from pathlib import Path

from simbench.bench.store.benchmark import benchmark_text
from simbench.page.document import Section, write
from simbench.report import (
    axes,
    failures,
    maps,
    overview,
    provenance,
    roc,
    summary,
)
from simbench.report.data import RunData

_SECTIONS = (
    summary,
    overview,
    maps,
    roc,
    axes,
    failures,
    provenance,
)


def write_report(run_folder: str | Path, path: str | Path, run: RunData | None = None) -> None:
    """Write a run's report, which may be read already: one self-contained HTML file, readable in
    light and dark and on a phone.

    Parameters
    ----------
    run_folder : str or Path
        Folder of a run.
    path : str or Path
        HTML file to write.
    run : RunData, optional
        The run, where it has been read already.
    """
    run = run or RunData.read(run_folder)
    manifest = run.book.manifest
    commit = str(manifest.get("commit") or "unknown")[:12]
    grid = f"grid {manifest['grid']} ({manifest['grid_hash']}){benchmark_text(manifest)}"
    origin = f"commit {commit}, {grid}, records {manifest.get('records_hash', '-')}"
    sections = [Section(s.__name__.rpartition(".")[2], s.TITLE, s.section(run)) for s in _SECTIONS]
    title = f"Stiction detectors on {manifest['grid']}"
    write(path, title, origin, sections, footer=f"Every number: {origin}.")
