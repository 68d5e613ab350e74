"""simbench: a closed-loop simulation testbench for valve-stiction detectors."""
