"""Is it the valve? The confirmation tests of the chapter on simulated loops."""
