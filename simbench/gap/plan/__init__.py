"""Which test to run next: a fixed order, and the menu of tests sized for a loop."""
