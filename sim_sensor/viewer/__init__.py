"""One self-contained page that plays what happened."""
