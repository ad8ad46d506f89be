"""`swarm hold`, `resume`, `return` and `abort`: an operator's words to a mission being flown."""
