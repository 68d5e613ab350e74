"""Store a run on disk: tables and manifest."""
