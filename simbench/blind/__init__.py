"""The blind checks: records of simulators that share the vocabulary of the gap and nothing else with what judges them."""
