"""From where the hand is to the object, in, back and out: free of collisions, and in time."""
