"""The protocol, pure: what is said on the bus, in which bytes, and the state it adds up to."""
