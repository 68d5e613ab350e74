"""What is a run? Plant, controller, valve, disturbances, and the compiled loop that joins them."""
