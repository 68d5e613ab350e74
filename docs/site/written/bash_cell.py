"""%%bash for the tutorials: what it prints comes in one piece, and what fails there fails the
build.
"""

import subprocess
import sys


def bash(line, cell):
    """Run a cell; the magic of IPython hands its output on in pieces of 100 bytes, which end up in
    separate lines.
    """
    done = subprocess.run(["bash", "-e"], input=cell, text=True, capture_output=True)
    print(done.stdout, end="")
    print(done.stderr, end="", file=sys.stderr)
    done.check_returncode()


get_ipython().register_magic_function(bash, "cell", "bash")  # noqa: F821
