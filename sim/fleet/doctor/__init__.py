"""`swarm doctor`: looks before a flight at everything the flight will lean on."""
