"""Independent plant simulators that test the gap diagnosis, one per subpackage."""
