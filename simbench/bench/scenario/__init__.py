"""What is simulated, and what is true of it."""
