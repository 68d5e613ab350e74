"""The small grid and its run, shared by the tests of the benchmark and of the studies."""

from bench_fixtures import book, finished, noisy, small, with_answers

__all__ = ["book", "finished", "noisy", "small", "with_answers"]
