"""Pages about results: the report of a run, and the chapter's numbers beside ours."""
