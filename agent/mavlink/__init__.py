"""The agent's bridge to a MAVLink autopilot: pure protocol machines under an asyncio shell."""
