"""Judge records from the command line: `python -m simbench.detectors` is `simbench detect`."""

import sys

from simbench.cli import main

if __name__ == "__main__":
    sys.exit(main(["detect"] + sys.argv[1:]))
