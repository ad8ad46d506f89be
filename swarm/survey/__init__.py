"""Areas cut into lines, what these cover, and what a camera sees from them: pure geometry."""
