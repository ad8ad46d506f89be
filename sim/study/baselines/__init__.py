"""What a user would pick instead, so that plans can be compared side by side.

Leaves out: running and timing them (`sim.bench`), and the methods of this project itself.
"""
