"""Store a run on disk: tables, manifest and checksums."""
