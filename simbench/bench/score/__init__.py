"""What a run says of its detectors: scores, ranks, comparisons, the gate."""
