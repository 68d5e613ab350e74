"""Find from single samples of PV what the sensor and the archive do."""
