"""What a user would pick instead, so that plans can be compared side by side."""
