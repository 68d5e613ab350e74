"""Two plain loops that many tests simulate: settings of `example_loop`."""

DELAYED = {"T": 3.0, "Td": 6.0, "Kc": 0.25, "Ti": 3.0}
LEVEL = {"process": "integrating", "K": 0.1, "Td": 1.0, "Kc": 1.5, "Ti": 30.0}
