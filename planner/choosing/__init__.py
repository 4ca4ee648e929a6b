"""Which touches: singular ones refused, the rest by what they are worth over the belief."""
