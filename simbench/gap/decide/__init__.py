"""From evidence to an answer: which effect, or none, or something unknown."""
