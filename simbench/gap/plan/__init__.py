"""Which test to run next: the menu, sized for a loop, and what each may be expected to tell."""
