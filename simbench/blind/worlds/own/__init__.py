"""The first independent simulator of the blind check: its own valve physics, controllers, historian, faults and oracle."""
