"""What do single samples of PV tell of the sensor and the archive?"""
