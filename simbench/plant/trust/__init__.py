"""Find which detector to trust on one loop, and which stiction its record could have shown
(`simbench trust`).
"""
