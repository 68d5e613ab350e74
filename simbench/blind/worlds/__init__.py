"""Independent simulators, one package each, written from the contract alone."""
