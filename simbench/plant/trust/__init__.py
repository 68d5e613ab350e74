"""One loop: whom to believe, what its record could have shown, how probable stiction is."""
