"""Real fleets under attack: processes killed at random moments, and insiders that lie."""
