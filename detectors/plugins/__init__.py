"""Find the file of a plug-in, run it in a separate process, and check its answers."""
