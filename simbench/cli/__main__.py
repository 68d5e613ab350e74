"""Start the command line with `python -m simbench.cli`."""

from simbench.cli import entry

entry()
