"""Turn evidence into an answer: which effect, none, or an unknown one."""
