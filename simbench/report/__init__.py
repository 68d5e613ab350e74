"""Write HTML pages about results: the report of a run, one file per section.

A report is one HTML file; every section is a file here with `TITLE` and `section(run)`, which
returns its parts. `python -m results.studies.chapter` and `python -m results.studies.gallery` write
two pages of docs.
"""

from simbench.report._write import write_report

__all__ = ["write_report"]
