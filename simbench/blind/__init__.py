"""The blind checks: simulators that judge a diagnosis they have never seen."""
