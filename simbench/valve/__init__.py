"""Valve maps from OP to valve position, one step each; whatever moves a valve uses these."""
