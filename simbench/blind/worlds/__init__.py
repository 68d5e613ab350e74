"""Independent simulators that judge the diagnosis: one world per package."""
