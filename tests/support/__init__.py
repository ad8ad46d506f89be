"""What several tests share: builders, players of parts, and recordings."""
