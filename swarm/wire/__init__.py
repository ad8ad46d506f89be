"""What is said on the bus, on which keys and in which bytes."""
