"""`relume stage`: the commands of a light stage."""
