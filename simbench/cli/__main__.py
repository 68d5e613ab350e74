"""`python -m simbench.cli`."""

from simbench.cli import entry

entry()
